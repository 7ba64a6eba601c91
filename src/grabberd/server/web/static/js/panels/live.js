// The live picture in full, and the aid for lamp and lens.
import { el } from "../core/dom.js";
import { createAid } from "../adjust/aid.js";
import { createTools } from "../adjust/tools.js";
import { createCurves } from "../live/curves.js";
import { createViewfinder } from "../live/viewfinder.js";

/** @import { Context } from "../core/context.js" */

export const panel = {
  title: "live.title",

  /** @param {HTMLElement} element @param {Context} context */
  mount(element, context) {
    const aid = createAid(context);
    const viewfinder = createViewfinder(context, { seen: (preview) => tools.seen(preview), lit: aid.lit });
    const tools = createTools(context, viewfinder.picture);
    const curves = createCurves(context);
    viewfinder.element.append(tools.element);
    element.append(el("h1", { class: "visually-hidden" }, context.t("live.title")), viewfinder.element, aid.element, curves.element);
    const parts = [viewfinder, tools, aid, curves];
    return { unmount: () => parts.forEach((part) => part.unmount()) };
  },
};
