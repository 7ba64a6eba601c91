// The quantities of every capture, as a table that can be sorted and taken home.
import { lineOf } from "../captures/words.js";
import { el, fill, symbol } from "../core/dom.js";
import { quantityIn, valueIn } from "../liner_tests/words.js";
import { csvOf } from "../plots/series.js";
import { save } from "../scene/picture.js";
import { verdictBadge } from "./verdicts.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture, QuantityStudied, Study } from "types/documents" */

/** Shown before all are asked for. */
const MAIN = ["liner_compression_mean_kpa", "liner_compression_mean_above_atmosphere_kpa", "overpressure_derived_kpa", "overpressure_raised_kpa", "overpressure_map_kpa", "teat_load_n", "stroke_mm", "rate_per_min", "wall_ratio", "touch_kpa", "buckling_kpa", "stiffness_n_mm"];

/** @param {Context} context @param {Study} study @param {Capture[]} captures those that were chosen */
export function createQuantities(context, study, captures) {
  const { t } = context;
  const all = el("input", { type: "checkbox", on: { change: draw } });
  const button = el("button", { class: "button", type: "button", data: { do: "csv" }, on: { click: download } }, symbol("download"), t("plots.csv"));
  const head = el("tr");
  const body = el("tbody");
  const element = el("section", { class: "card stack" }, el("div", { class: "row between" }, el("h2", {}, t("compare.quantities")), el("div", { class: "row" }, el("label", { class: "check" }, all, t("compare.all")), button)), el("div", { class: "scroll", tabindex: 0 }, el("table", { class: "table compare-table" }, el("thead", {}, head), body)));
  const reasons = new Map(study.left_out.filter(({ quantity }) => !quantity).map(({ capture, reason }) => [capture, reason]));
  /** @type {{name: string, down: boolean} | null} */
  let order = null;

  const shown = () => {
    const main = study.quantities.filter(({ name, verdict }) => verdict === "differ" || MAIN.includes(name));
    return all.checked || !main.length ? study.quantities : main;
  };

  /** @param {QuantityStudied} one @param {string} id */
  function at(one, id) {
    const i = one.values.capture.indexOf(id);
    return i < 0 ? null : { value: one.values.value[i], sigma: one.values.sigma[i] };
  }

  function sorted() {
    if (!order) return captures;
    const { name, down } = order;
    const one = study.quantities.find((each) => each.name === name);
    const key = (/** @type {Capture} */ capture) => (one ? (at(one, capture.id)?.value ?? Infinity) : lineOf(context, capture));
    const compare = (/** @type {Capture} */ a, /** @type {Capture} */ b) => {
      const [left, right] = [key(a), key(b)];
      // Those without a value stay at the end, whichever way it is sorted.
      if (left === Infinity || right === Infinity) return left === right ? 0 : left === Infinity ? 1 : -1;
      const less = typeof left === "string" ? left.localeCompare(String(right), undefined, { numeric: true }) : left - Number(right);
      return down ? -less : less;
    };
    return [...captures].sort(compare);
  }

  /** @param {string} name @param {import("types/elements").Child} words @param {import("types/elements").Child} [more] */
  function heading(name, words, more = null) {
    const sort = order?.name === name ? (order.down ? "descending" : "ascending") : "none";
    const turn = () => {
      order = { name, down: order?.name === name ? !order.down : false };
      draw();
      /** @type {HTMLElement | null} */ (head.querySelector(`[data-sort="${name}"]`))?.focus();
    };
    const sign = { ascending: " ▲", descending: " ▼", none: "" }[sort];
    return el("th", { scope: "col", "aria-sort": sort, class: name ? "number" : "" }, el("button", { class: "compare-sort", type: "button", data: { sort: name }, on: { click: turn } }, words, sign), more);
  }

  function draw() {
    const quantities = shown();
    fill(head, heading("", t("compare.capture")), quantities.map((one) => heading(one.name, [quantityIn(context, { ...one, value: null, sigma: null }), one.unit === "1" ? "" : `, ${one.unit}`], one.verdict === "differ" ? verdictBadge(context, one.verdict) : null)));
    fill(body, sorted().map((capture) => row(capture, quantities)));
  }

  /** @param {Capture} capture @param {QuantityStudied[]} quantities */
  function row(capture, quantities) {
    const link = el("a", { href: `#analysis/${encodeURIComponent(capture.id)}` }, lineOf(context, capture));
    const reason = reasons.get(capture.id);
    const failed = capture.analysis?.state === "failed" ? capture.analysis.problem?.message : null;
    const cells = reason ? [el("td", { colspan: Math.max(1, quantities.length), class: "muted" }, failed ?? reasonIn(reason))] : quantities.map((one) => el("td", { class: "number" }, valueIn(context, at(one, capture.id)?.value, at(one, capture.id)?.sigma, "")));
    return el("tr", { data: { capture: capture.id } }, el("th", { scope: "row" }, link), cells);
  }

  /** @param {string} reason the instrument's */
  function reasonIn(reason) {
    const key = reason.replace(/\W+/g, "_");
    return context.texts.has(`compare.reason.${key}`) ? t(`compare.reason.${key}`) : reason;
  }

  /** All that the study has of the captures, with σ and units. */
  function download() {
    const { columns } = study.tables.captures;
    const cell = (/** @type {string | number | null} */ value) => (typeof value === "string" ? `"${value.replaceAll('"', '""')}"` : value);
    save(new Blob([csvOf(columns.map(({ name }) => name), /** @type {(number | null)[][]} */ (columns.map(({ values }) => values.map(cell))))], { type: "text/csv" }), "compare.csv");
  }

  draw();
  return element;
}
