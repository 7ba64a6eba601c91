// Curves over the capture, or over the mean cycle, with their σ.
import { el, fill } from "../core/dom.js";
import { INKS, createChart } from "../plots/chart.js";
import { columnsOf, summaryOf } from "../plots/series.js";
import { column, hasAny } from "./tables.js";

/** @import { Context } from "../core/context.js" */
/** @import { Analysis, Table } from "types/documents" */

/** @typedef {"time" | "phase"} Over the capture, or the mean cycle */

/**
 * @typedef {object} Chart
 * @property {string} name
 * @property {string} unit
 * @property {number} digits
 * @property {string} time table over time
 * @property {string | null} phase table over the mean cycle
 * @property {string[] | null} lines its columns, the first with its band; null: one for each height
 */

/** @type {Chart[]} */
const CHARTS = [
  { name: "movement", unit: "mm", digits: 2, time: "fields", phase: null, lines: ["movement_mm"] },
  { name: "distance", unit: "mm", digits: 2, time: "sections", phase: "phase_sections", lines: null },
  { name: "contact", unit: "kPa", digits: 2, time: "fields", phase: "phases", lines: ["mean_contact_kpa", "greatest_contact_kpa"] },
  { name: "vacuum", unit: "kPa", digits: 1, time: "fields", phase: "phases", lines: ["pulsation_vacuum_kpa", "liner_vacuum_kpa"] },
];
const MOST_LINES = 3;
/** @type {Over[]} */
const OVERS = ["time", "phase"];

/** @typedef {{label: string, column: string, values: (number | null)[], sigma: (number | null)[]}} Line */

/** @param {Context} context @param {Analysis} document @param {string} file begin of the files' names @param {number} field_s from field to field */
export function createCurves(context, document, file, field_s) {
  const { t, format } = context;
  const place = el("div", { class: "plots-grid" });
  const none = el("p", { class: "muted" });
  const over = OVERS.filter((one) => one === "time" || column(document.tables.phases, "phase").length);
  const first = over.at(-1) ?? "time"; // the mean cycle, as in the report
  const choices = el("div", { class: "choices analysis-over", role: "radiogroup", "aria-label": t("analysis.over.title"), hidden: over.length < 2 }, over.map((one) => el("label", {}, el("input", { type: "radio", name: "analysis-over", checked: one === first, on: { change: () => show(one) } }), t(`analysis.over.${one}`))));
  const element = el("section", { class: "stack" }, el("div", { class: "row between" }, el("h2", {}, t("analysis.curves")), choices), place, none);
  /** @type {ReturnType<typeof createChart>[]} */
  let charts = [];

  /** @param {Over} one */
  function show(one) {
    end();
    const found = CHARTS.flatMap((chart) => {
      const table = chart[one];
      return table ? [{ chart, ...linesOf(chart, document.tables[table], one) }] : [];
    });
    const shown = found.filter(({ lines }) => lines.length);
    charts = shown.map(({ chart, x, lines }) => chartOf(chart, one, x, lines));
    fill(place, ...charts.map(({ element }) => element));
    const lacking = found.filter(({ lines }) => !lines.length).map(({ chart }) => t(`analysis.curve.${chart.name}`));
    none.hidden = !lacking.length;
    fill(none, t("analysis.noCurve", { names: lacking.join(", ") }));
  }

  /** @param {Chart} chart @param {Table | undefined} table @param {Over} over */
  function linesOf(chart, table, over) {
    const key = over === "time" ? "time_s" : "phase";
    if (chart.lines) {
      const lines = chart.lines.map((name) => ({ label: t(`analysis.line.${name}`), column: name, values: column(table, name), sigma: column(table, `sigma_${name}`) }));
      return { x: column(table, key), lines: lines.filter((line) => hasAny(line.values)) };
    }
    return sectionsOf(table, key);
  }

  /** A line for each height: how far apart opposite walls are, or the wall and the plane. @param {Table | undefined} table @param {string} key */
  function sectionsOf(table, key) {
    const name = hasAny(column(table, "opposite_mm")) ? "opposite_mm" : "distance_mm";
    const heights = column(table, "height_mm");
    const rows = (/** @type {number | null} */ height) => heights.map((one, i) => (one === height ? i : -1)).filter((i) => i >= 0);
    const each = [...new Set(heights)].slice(0, MOST_LINES).map((height) => ({ height, rows: rows(height) }));
    const pick = (/** @type {string} */ what, /** @type {number[]} */ of) => of.map((i) => column(table, what)[i] ?? null);
    const lines = each.map((one) => ({ label: t("analysis.line.height", { mm: format.number(one.height, 0) }), column: `${name.replace("_mm", "")}_at_${one.height}_mm`, values: pick(name, one.rows), sigma: pick(`sigma_${name}`, one.rows) }));
    return { x: each.length ? pick(key, each[0].rows) : [], lines: lines.filter((line) => hasAny(line.values)) };
  }

  /** @param {Chart} chart @param {Over} over @param {(number | null)[]} places @param {Line[]} lines */
  function chartOf(chart, over, places, lines) {
    const when = over === "time" ? (/** @type {number} */ s) => `${format.number(s, 1)} s` : (/** @type {number} */ share) => `${format.number(share * 100, 0)} %`;
    const title = t(`analysis.curve.${chart.name}`);
    const inks = lines.map((line, i) => ({ label: line.label, column: line.column, ink: INKS[i] }));
    const x = { name: over === "time" ? "time_s" : "phase", label: t(`analysis.axis.${over}`) };
    const made = createChart(context, { title, unit: chart.unit, digits: chart.digits, when, x, band: true, together: `analysis-${over}`, lines: inks, file: `${file}-${chart.name}-${over}` });
    const samples = places.flatMap((time_s, i) => (time_s === null ? [] : [{ time_s, i }]));
    /** @typedef {{i: number}} Sample */
    const edge = (/** @type {number} */ sigmas) => (/** @type {Sample} */ { i }) => edgeOf(lines[0], i, sigmas);
    const picks = [...lines.map((line) => (/** @type {Sample} */ { i }) => line.values[i]), edge(1), edge(-1), ...lines.map((line) => (/** @type {Sample} */ { i }) => line.sigma[i])];
    const columns = columnsOf(samples, picks, over === "time" ? 1.5 * field_s : 1);
    const summary = summaryOf(columns[1]);
    const words = summary ? t("plots.words", { name: title, last: format.number(summary.last, chart.digits), least: format.number(summary.least, chart.digits), greatest: format.number(summary.greatest, chart.digits) }) : title;
    made.set(columns.slice(0, lines.length + 3), words, columns.slice(lines.length + 3));
    return made;
  }

  function end() {
    charts.forEach((one) => one.end());
    charts = [];
  }
  show(first);
  return { element, end };
}

/** A value with so many σ; null where there is none. @param {Line} line @param {number} i @param {number} sigmas */
function edgeOf({ values, sigma }, i, sigmas) {
  const value = values[i];
  return value === null ? null : value + sigmas * (sigma[i] ?? 0);
}
