// What was found, as on the report's first page: the quantities with σ and verdict, and why others are missing.
import { el, symbol } from "../core/dom.js";
import { quantityIn, sentence, valueIn } from "../liner_tests/words.js";
import { column, single, words } from "./tables.js";

/** @import { Context } from "../core/context.js" */
/** @import { Analysis, AnalysisRow, Capture } from "types/documents" */

/** What the summary tells beside the quantities: how the clocks were related. */
const CLOCKS = /** @type {const} */ ([["offset_s", "s"], ["clock_kpa", "kPa"]]);

/** Level and symbol. @type {Record<string, [string, string]>} */
const LIMITS = { met: ["good", "ok"], "not met": ["bad", "bad"], "not certain": ["warn", "warn"] };

/**
 * @typedef {object} Found
 * @property {string} name
 * @property {string} title
 * @property {string} definition
 * @property {string} unit
 * @property {number | null} value
 * @property {number | null} sigma
 * @property {string} verdict
 * @property {string} reason
 */

/** @param {Analysis} document @returns {Found[]} */
export function foundIn(document) {
  const table = document.tables.quantities;
  const texts = (/** @type {string} */ name) => words(table, name);
  const [value, sigma] = [column(table, "value"), column(table, "sigma_value")];
  return texts("name").map((name, i) => ({
    name, title: texts("title")[i], definition: texts("definition")[i], unit: texts("unit")[i],
    value: value[i] ?? null, sigma: sigma[i] ?? null, verdict: texts("verdict")[i] ?? "", reason: texts("reason")[i] ?? "",
  }));
}

/** @param {Context} context @param {Capture} capture @param {Analysis} document @param {AnalysisRow} record */
export function createFound(context, capture, document, record) {
  const { t, tn } = context;
  const all = foundIn(document);
  const known = all.filter(({ value }) => value !== null);

  /** @param {Found} one */
  const row = (one) => el("tr", { data: { quantity: one.name } }, el("th", { scope: "row", title: one.definition }, quantityIn(context, { ...one, sigma_common: null })), el("td", { class: "number" }, valueIn(context, one.value, one.sigma, one.unit)), el("td", {}, verdict(one.verdict)));

  /** @param {string} said by the limits of ISO 5707 */
  function verdict(said) {
    if (!said) return null;
    const [level, sign] = LIMITS[said] ?? ["idle", "info"];
    return el("span", { class: `badge is-${level}` }, symbol(sign), t(`analysis.limit.${said.replace(" ", "_")}`));
  }

  /** Why there is no value, each reason once. */
  function missing() {
    const without = all.filter(({ value }) => value === null);
    if (!without.length) return null;
    const reasons = [...new Set(without.map(({ reason }) => reason))];
    const item = (/** @type {string} */ reason) => el("li", {}, el("strong", {}, reason ? sentence(reason) : "–"), el("span", { class: "small muted" }, without.filter((one) => one.reason === reason).map((one) => quantityIn(context, { ...one, sigma_common: null })).join(", ")));
    return el("details", {}, el("summary", { class: "capture-summary" }, tn("analysis.without", without.length)), el("ul", { class: "analysis-without" }, reasons.map(item)));
  }

  /** @param {typeof CLOCKS[number]} fact */
  function clock([name, unit]) {
    const { value, sigma } = single(document.tables.summary, name);
    return value === null ? null : [el("dt", {}, t(`analysis.fact.${name}`)), el("dd", {}, valueIn(context, value, sigma, unit))];
  }

  const analysed = column(document.tables.summary, "analysed")[0] ?? 0;
  const facts = el("dl", { class: "facts" }, el("dt", {}, t("analysis.fact.analysed")), el("dd", {}, tn("captures.fields", analysed)), CLOCKS.map(clock));
  const table = known.length ? el("div", { class: "scroll", tabindex: 0 }, el("table", { class: "table analysis-found" }, el("thead", {}, el("tr", {}, ["quantity", "value", "verdict"].map((name) => el("th", { scope: "col", class: name === "value" ? "number" : "" }, t(`analysis.column.${name}`))))), el("tbody", {}, known.map(row)))) : el("p", { class: "muted" }, t("analysis.without.all"));
  return el("div", { class: "stack" }, table, missing(), facts, lacks(context, capture, record.lacks ?? []), problems(context, record.problems ?? []));
}

/** Inputs that were not given, and the consequences. @param {Context} context @param {Capture} capture @param {string[]} given */
function lacks({ t, texts }, { labels }, given) {
  if (!given.length) return null;
  const slugs = given.map((text) => [text.split(":")[0].replace(/\W+/g, "_"), text]);
  const said = slugs.map(([slug, text]) => (texts.has(`analysis.lack.${slug}`) ? t(`analysis.lack.${slug}`, { name: labels[slug.split("_")[0]] ?? "" }) : text));
  return el("div", { class: "note is-idle" }, symbol("info"), el("div", {}, el("strong", {}, t("analysis.lacks")), el("ul", {}, [...new Set(said)].map((text) => el("li", {}, text)))));
}

/** Problems that the analysis survived, in the instrument's own words. @param {Context} context @param {string[]} found */
function problems({ tn }, found) {
  if (!found.length) return null;
  const list = el("ul", { lang: "en" }, found.map((text) => el("li", {}, text)));
  return el("div", { class: "note is-warn" }, symbol("warn"), el("details", { class: "grow" }, el("summary", { class: "capture-summary" }, tn("analysis.problems", found.length)), list));
}
