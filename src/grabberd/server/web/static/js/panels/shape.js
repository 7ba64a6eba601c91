// The liner in space, as it is now.
import { el } from "../core/dom.js";
import { createLiveView } from "../scene/live_view.js";
import { createSubjectBar } from "../scene/subject_bar.js";

/** @import { PanelContext } from "./index.js" */

export const panel = {
  title: "shape.title",

  /** @param {HTMLElement} element @param {PanelContext} context */
  mount(element, context) {
    const body = el("div", { class: "stack" });
    element.classList.add("subject-panel");
    element.append(createSubjectBar(context, "shape"), body);
    const view = createLiveView(context, body);
    return { unmount: view.end };
  },
};
