// Choice of the subject, live or a capture to be replayed, and of the live view: in space or over time.
import { createChooser } from "../captures/chooser.js";
import { el } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */

/**
 * @param {Context} context
 * @param {"shape" | "plots"} way which of them this is
 */
export function createSubjectBar(context, way) {
  const { t, go } = context;
  const titles = { shape: t("shape.title"), plots: t("plots.title") };
  const tabs = { shape: t("shape.tab"), plots: t("plots.tab") };
  const chooser = createChooser(context, { label: t("shape.subject"), none: t("shape.live"), choose: (one) => one && go("replay", one) });
  chooser.element.classList.add("subject-choice");
  const link = (/** @type {"shape" | "plots"} */ one) =>
    el("a", { class: "button", href: `#${one}`, "aria-current": one === way ? "page" : null }, tabs[one]);
  return el(
    "header", { class: "subject-bar" },
    el("h1", {}, titles[way]),
    chooser.element,
    el("nav", { class: "row", "aria-label": t("shape.ways") }, link("shape"), link("plots")),
  );
}
