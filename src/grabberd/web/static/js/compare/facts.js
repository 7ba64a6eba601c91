// Two captures side by side, in facts.
import { badge, labelsIn, ledgerIn, lengthIn, measuredBadge } from "../captures/words.js";
import { el } from "../core/dom.js";
import { strokeOf } from "./course.js";

/** @import { Context } from "../core/context.js" */
/** @import { Course } from "./course.js" */
/** @import { Side } from "./side.js" */
/** @import { Child } from "types/elements" */

/**
 * @param {Context} context
 * @param {Side[]} sides
 * @param {Course[]} courses of a target in the middle
 */
export function createFacts(context, sides, courses) {
  const { t, format } = context;
  const measured = (/** @type {number | null | undefined} */ value, /** @type {number} */ digits, /** @type {string} */ unit) => (Number.isFinite(value) ? `${format.number(value, digits)} ${unit}` : "–");
  /** @type {Record<string, (side: Side, i: number) => Child>} */
  const rows = {
    labels: ({ capture }) => labelsIn(context, capture) || "–",
    verdict: ({ capture }) => badge(context, capture),
    measured: ({ capture }) => measuredBadge(context, capture.coverage) ?? "–",
    losses: ({ capture }) => ledgerIn(context, capture),
    length: ({ capture }) => lengthIn(context, capture),
    stroke: (_, i) => measured(strokeOf(courses[i]), 2, "mm"),
    rate: ({ analysis }) => (analysis ? measured(analysis.summary?.rate_per_min, 2, "1/min") : t("compare.notAnalysed")),
    targets: ({ sample }) => measured(sample?.targets, 0, ""),
    residual: ({ sample }) => measured(sample?.residual_px, 3, "px"),
    sigma: ({ sample }) => measured(sample?.sigma_mm, 3, "mm"),
    calibration: ({ calibration }) => calibration?.id ?? "–",
  };
  const heads = sides.map(({ capture }, i) => el("th", { scope: "col" }, el("span", { class: `chart-swatch plot-${i + 1}`, "aria-hidden": "true" }), " ", el("a", { href: `#captures/${encodeURIComponent(capture.id)}` }, `${format.day(capture.created_utc)}, ${format.time(capture.created_utc)}`)));
  const lines = Object.entries(rows).map(([name, pick]) => el("tr", { data: { fact: name } }, el("th", { scope: "row" }, t(`compare.fact.${name}`)), sides.map((side, i) => el("td", {}, pick(side, i)))));
  return el("div", { class: "scroll" }, el("table", { class: "table compare-facts" }, el("thead", {}, el("tr", {}, el("td", {}), heads)), el("tbody", {}, lines)));
}
