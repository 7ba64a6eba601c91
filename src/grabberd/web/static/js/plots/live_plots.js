// The last minutes: targets, residual, latency, width.
import { el } from "../core/dom.js";
import { GAP_S } from "../core/history.js";
import { keep, kept } from "../core/kept.js";
import { INKS, createChart } from "./chart.js";
import { pairOf } from "./facing_pair.js";
import { columnsOf, summaryOf } from "./series.js";
import { createTable } from "./table.js";

/** @import { Context } from "../core/context.js" */
/** @import { History, Sample } from "../core/history.js" */
/** @import { Column } from "./series.js" */

const SPANS_MIN = [1, 5, 10];
const KEPT = "plots.minutes";
const EVERY_MS = 400;
const DASH = [7, 4];

/** @param {Context} context @param {HTMLElement} body @param {History} history */
export function createLivePlots(context, body, history) {
  const { t, format } = context;
  let minutes = SPANS_MIN.find((one) => one === kept(KEPT)) ?? SPANS_MIN[0];
  let last_ms = -Infinity;
  /** @type {Column[][]} */
  let shown = [];

  const plots = PLOTS.map((plot) => ({ ...plot, chart: createChart(context, optionsOf(plot)) }));
  const table = createTable(context, rows, file);
  const spans = SPANS_MIN.map((one) => {
    const radio = el("input", { type: "radio", name: "span", value: one, checked: one === minutes, on: { change: () => choose(one) } });
    return el("label", {}, radio, t("plots.minutes", { n: one }));
  });
  body.append(
    el("div", { class: "plots-tools" }, el("div", { class: "choices", role: "radiogroup", "aria-label": t("plots.span") }, spans), table.button),
    el("div", { class: "plots-grid" }, plots.map((plot) => plot.chart.element)),
    table.element,
  );

  /** @param {(typeof PLOTS)[number]} plot */
  function optionsOf(plot) {
    const lines = plot.lines.map((line, i) => ({ label: t(`plots.line.${line.name}`), ink: INKS[i], dash: i ? DASH : undefined }));
    const when = (/** @type {number} */ s) => format.time(1000 * s);
    return { title: t(`plots.chart.${plot.name}`), unit: plot.unit, digits: plot.digits, lines, band: plot.name === "width", when, together: "live", least: plot.least };
  }

  /** @param {number} chosen */
  function choose(chosen) {
    minutes = chosen;
    keep(KEPT, minutes);
    draw();
  }

  function draw() {
    const samples = history.samples(context.device()?.name ?? "", 60 * minutes);
    const pair = pairOf(samples);
    shown = plots.map((plot) => columnsOf(samples, plot.picks(pair), GAP_S));
    plots.forEach((plot, i) => plot.chart.set(shown[i], wordsOf(plot, shown[i])));
    table.show();
  }

  /** @param {(typeof plots)[number]} plot @param {Column[]} columns */
  function wordsOf(plot, columns) {
    const number = (/** @type {number} */ value) => format.number(value, plot.digits);
    const words = plot.lines.map((line, i) => {
      const summary = summaryOf(columns[i + 1]);
      const name = t(`plots.line.${line.name}`);
      return summary && t("plots.words", { name, last: number(summary.last), least: number(summary.least), greatest: number(summary.greatest) });
    });
    return [t(`plots.chart.${plot.name}`), plot.unit, ...words].filter(Boolean).join(" ");
  }

  function rows() {
    return plots.flatMap((plot, p) => plot.lines.map((line, i) => ({ name: t(`plots.line.${line.name}`), unit: plot.unit, digits: plot.digits, column: shown[p]?.[i + 1] ?? [] })));
  }

  function file() {
    const samples = history.samples(context.device()?.name ?? "", 60 * minutes);
    const pair = pairOf(samples);
    const picks = plots.flatMap((plot) => plot.picks(pair).slice(0, plot.lines.length));
    const names = ["time_unix_s", ...plots.flatMap((plot) => plot.lines.map((line) => line.column))];
    return { name: "live.csv", names, columns: columnsOf(samples, picks, GAP_S) };
  }

  function soon() {
    if (document.hidden || performance.now() - last_ms < EVERY_MS) return;
    last_ms = performance.now();
    draw();
  }

  draw();
  const end = history.watch(soon);
  return {
    end() {
      end();
      plots.forEach((plot) => plot.chart.end());
    },
  };
}

/** @typedef {(sample: Sample) => number | null} Value */

/** @param {...Value} picks @returns {(pair: number) => Value[]} */
const fixed = (...picks) => () => picks;

/** @type {{name: string, unit: string, digits: number, least?: [number, number], lines: {name: string, column: string}[], picks: (pair: number) => Value[]}[]} */
const PLOTS = [
  {
    name: "targets", unit: "", digits: 0, least: [0, 10],
    lines: [{ name: "left", column: "targets_left" }, { name: "right", column: "targets_right" }, { name: "points", column: "points" }],
    picks: fixed((sample) => sample.left, (sample) => sample.right, (sample) => sample.points),
  },
  { name: "residual", unit: "px", digits: 3, least: [0, 0.2], lines: [{ name: "residual", column: "residual_px" }], picks: fixed((sample) => sample.residual_px) },
  {
    name: "latency", unit: "ms", digits: 1, least: [0, 10], lines: [{ name: "p50", column: "latency_p50_ms" }, { name: "p99", column: "latency_p99_ms" }],
    picks: fixed((sample) => sample.p50_ms, (sample) => sample.p99_ms),
  },
  {
    name: "width", unit: "mm", digits: 2, lines: [{ name: "width", column: "section_width_mm" }],
    picks: (pair) => [widthOf(pair, 0), widthOf(pair, 1), widthOf(pair, -1)],
  },
];

/** @param {number} pair @param {number} sigmas beside it */
const widthOf = (pair, sigmas) => (/** @type {Sample} */ sample) => {
  const width = sample.widths[pair];
  return width?.width_mm == null ? null : width.width_mm + sigmas * (width.sigma_mm ?? 0);
};
