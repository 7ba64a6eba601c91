// The last minutes over time.
import { el } from "../core/dom.js";
import { createLivePlots } from "../plots/live_plots.js";
import { createSubjectBar } from "../scene/subject_bar.js";

/** @import { PanelContext } from "./index.js" */

export const panel = {
  title: "plots.title",

  /** @param {HTMLElement} element @param {PanelContext} context */
  mount(element, context) {
    const body = el("div", { class: "stack" });
    element.classList.add("subject-panel");
    element.append(createSubjectBar(context, "plots"), body);
    const view = createLivePlots(context, body);
    return { unmount: view.end };
  },
};
