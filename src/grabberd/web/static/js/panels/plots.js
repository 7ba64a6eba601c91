// Over time: the last minutes live, or a target of a capture.
import { el } from "../core/dom.js";
import { createCapturePlots } from "../plots/capture_plots.js";
import { createLivePlots } from "../plots/live_plots.js";
import { createSubjectBar } from "../scene/subject_bar.js";

export const panel = {
  id: "plots",
  title: "plots.title",
  roles: ["viewer", "operator", "admin"],

  /** @param {HTMLElement} element @param {any} context */
  mount(element, context) {
    const id = context.parameters.id;
    const body = el("div", { class: "stack" });
    element.classList.add("subject-panel");
    element.append(createSubjectBar(context, "plots", id), body);
    const view = id ? createCapturePlots(context, body, id, Number(context.parameters.target ?? NaN)) : createLivePlots(context, body, context.history);
    return { unmount: view.end };
  },
};
