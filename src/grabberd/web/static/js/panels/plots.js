// Over time: the last minutes live, or a target of a capture.
import { el } from "../core/dom.js";
import { createCapturePlots } from "../plots/capture_plots.js";
import { createLivePlots } from "../plots/live_plots.js";
import { createSubjectBar } from "../scene/subject_bar.js";

/** @import { PanelContext } from "./index.js" */

export const panel = {
  title: "plots.title",

  /** @param {HTMLElement} element @param {PanelContext} context */
  mount(element, context) {
    const id = context.parameters.id;
    const body = el("div", { class: "stack" });
    element.classList.add("subject-panel");
    element.append(createSubjectBar(context, "plots", id), body);
    const view = id ? createCapturePlots(context, body, id, Number(context.parameters.target ?? NaN)) : createLivePlots(context, body, context.history);
    return { unmount: view.end };
  },
};
