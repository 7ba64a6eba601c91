// Summary of an analysis: pulsation, its phases, missing inputs, problems.
import { el, symbol } from "../core/dom.js";
import { column, single } from "./tables.js";

/** @import { Context } from "../core/context.js" */
/** @import { Analysis, AnalysisRow } from "types/documents" */

const FACTS = /** @type {[string, string, number][]} */ ([["rate_per_min", "1/min", 2], ["period_s", "s", 3], ["stroke_mm", "mm", 2], ["wall_ratio", "%", 1], ["iso_ratio", "%", 1], ["offset_s", "s", 3], ["opening_lag_s", "s", 4], ["closing_lag_s", "s", 4], ["clock_kpa", "kPa", 2]]);
const PHASES = ["a", "b", "c", "d"];

/** @param {Context} context @param {Analysis} document @param {AnalysisRow} record */
export function createSummary(context, document, record) {
  const { t, tn, format } = context;
  const table = document.tables.summary;

  /** @param {[string, string, number]} fact */
  function fact([name, unit, digits]) {
    const { value, sigma } = single(table, name);
    if (value === null) return null;
    const times = unit === "%" ? 100 : 1;
    return [el("dt", {}, t(`analysis.fact.${name}`)), el("dd", {}, `${spread(value * times, sigma === null ? null : sigma * times, digits)} ${unit}`)];
  }

  /** To the digit in which its σ begins. @param {number} value @param {number | null} sigma @param {number} digits without a σ */
  function spread(value, sigma, digits) {
    if (!sigma) return format.number(value, digits);
    const places = Math.min(6, Math.max(0, -Math.floor(Math.log10(sigma))));
    return `${format.number(value, places)} ± ${format.number(sigma, places)}`;
  }

  /** @param {string} kind */
  function phases(kind) {
    const found = PHASES.map((phase) => ({ phase, ...single(table, `${kind}_${phase}_s`) }));
    if (found.every(({ value }) => value === null)) return null;
    const words = found.map(({ phase, value, sigma }) => t("analysis.phase", { phase, ms: format.number((value ?? NaN) * 1000, 0), sigma: format.number((sigma ?? NaN) * 1000, 1) }));
    return [el("dt", {}, t(`analysis.phases.${kind}`)), el("dd", {}, words.join(", "))];
  }

  const analysed = column(table, "analysed")[0] ?? 0;
  const facts = el("dl", { class: "facts" }, el("dt", {}, t("analysis.fact.analysed")), el("dd", {}, tn("captures.fields", analysed)), FACTS.map(fact), phases("wall"), phases("iso"));
  return el("div", { class: "stack" }, facts, lacks(context, record.lacks ?? []), problems(context, record.problems ?? []));
}

/** Inputs that were not given, and the consequences. @param {Context} context @param {string[]} given */
function lacks({ t, texts }, given) {
  if (!given.length) return null;
  const slugs = given.map((text) => [text.split(":")[0].replace(/\W+/g, "_"), text]);
  const words = slugs.map(([slug, text]) => (texts.has(`analysis.lack.${slug}`) ? t(`analysis.lack.${slug}`) : text));
  return el("div", { class: "note is-idle" }, symbol("info"), el("div", {}, el("strong", {}, t("analysis.lacks")), el("ul", {}, [...new Set(words)].map((text) => el("li", {}, text)))));
}

/** Problems that the analysis survived, in the instrument's own words. @param {Context} context @param {string[]} found */
function problems({ tn }, found) {
  if (!found.length) return null;
  const list = el("ul", { lang: "en" }, found.map((text) => el("li", {}, text)));
  return el("div", { class: "note is-warn" }, symbol("warn"), el("details", { class: "grow" }, el("summary", { class: "capture-summary" }, tn("analysis.problems", found.length)), list));
}
