// The live picture in full, and the aid for lamp and lens.
import { el } from "../core/dom.js";
import { createAid } from "../live/aid.js";
import { createViewfinder } from "../live/viewfinder.js";

/** @import { Context } from "../core/context.js" */

export const panel = {
  title: "live.title",

  /** @param {HTMLElement} element @param {Context} context */
  mount(element, context) {
    const viewfinder = createViewfinder(context, { buttons: true });
    const aid = createAid(context);
    element.append(el("h1", { class: "visually-hidden" }, context.t("live.title")), viewfinder.element, aid.element);
    return {
      unmount() {
        viewfinder.unmount();
        aid.unmount();
      },
    };
  },
};
