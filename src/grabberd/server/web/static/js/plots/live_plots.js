// The last minutes, field by field, as the daemon has kept them: targets, residual, latency, width, vacuum.
import { el } from "../core/dom.js";
import { keep, kept } from "../core/kept.js";
import { deviceOf, rateOf } from "../core/store.js";
import { LOGGER_GAP_S, gapOf } from "../live/curves.js";
import { followCurves } from "../live/curves_feed.js";
import { loggersOf } from "../live/curves_message.js";
import { INKS, createChart } from "./chart.js";
import { pairOf } from "./facing_pair.js";
import { columnsOf, summaryOf } from "./series.js";
import { createTable } from "./table.js";

/** @import { Context } from "../core/context.js" */
/** @import { Curves, Sample } from "../live/curves_message.js" */
/** @import { Column } from "./series.js" */

const SPANS_MIN = [1, 5];
const KEPT = "plots.minutes";
/** A longer span is drawn less often: it changes less, and takes longer. */
const EVERY_MS_A_MINUTE = 400;
const DASHES = [undefined, [7, 4], [2, 4], [12, 4, 2, 4]];

/** @param {Context} context @param {HTMLElement} body */
export function createLivePlots(context, body) {
  const { t, texts, format, store } = context;
  const device = deviceOf(store.get());
  const channels = loggersOf(store.get().state, device?.name).flatMap((one) => one.channels);
  const plots = [...PLOTS, ...(channels.length ? [vacuumOf(channels)] : [])].map((plot) => ({ ...plot, chart: createChart(context, optionsOf(plot)) }));
  let minutes = SPANS_MIN.find((one) => one === kept(KEPT)) ?? SPANS_MIN[0];
  let last_ms = -Infinity;
  /** @type {Curves | null} */
  let curves = null;
  /** @type {Column[][]} */
  let shown = [];
  let feed = follow();

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

  /** @param {Plot} plot */
  function optionsOf(plot) {
    const lines = plot.lines.map((line, i) => ({ label: labelOf(line), ink: INKS[i % INKS.length], dash: DASHES[i % DASHES.length] }));
    const when = (/** @type {number} */ s) => format.time(1000 * s);
    return { title: t(`plots.chart.${plot.name}`), unit: plot.unit, digits: plot.digits, lines, band: plot.name === "width", when, together: "live", least: plot.least };
  }

  /** @param {Plot["lines"][number]} line */
  function labelOf({ name }) {
    const key = [`plots.line.${name}`, `live.curves.channel.${name}`].find(texts.has);
    return key ? t(key) : name;
  }

  function follow() {
    return followCurves(context, 60 * minutes, (fresh) => {
      curves = fresh;
      if (performance.now() - last_ms < EVERY_MS_A_MINUTE * minutes) return;
      last_ms = performance.now();
      draw();
    });
  }

  /** @param {number} chosen */
  function choose(chosen) {
    minutes = chosen;
    keep(KEPT, minutes);
    last_ms = -Infinity;
    feed.end();
    feed = follow();
  }

  function draw() {
    shown = columns();
    plots.forEach((plot, i) => plot.chart.set(shown[i], wordsOf(plot, shown[i])));
    table.show();
  }

  /** Of every chart, times since 1970 first. */
  function columns() {
    const { fields, readings, epoch_s } = curves ?? { fields: [], readings: [], epoch_s: 0 };
    const pair = pairOf(fields);
    const gap_s = gapOf(rateOf(deviceOf(store.get())));
    return plots.map((plot) => {
      const [times, ...values] = plot.picks ? columnsOf(fields, plot.picks(pair), gap_s) : columnsOf(readings, plot.lines.map(({ name }) => (one) => one.kpa[name]), LOGGER_GAP_S);
      return [times.map((time) => (time === null ? null : time + epoch_s)), ...values];
    });
  }

  /** @param {(typeof plots)[number]} plot @param {Column[]} columns */
  function wordsOf(plot, columns) {
    const number = (/** @type {number} */ value) => format.number(value, plot.digits);
    const words = plot.lines.map((line, i) => {
      const summary = summaryOf(columns[i + 1]);
      return summary && t("plots.words", { name: labelOf(line), last: number(summary.last), least: number(summary.least), greatest: number(summary.greatest) });
    });
    return [t(`plots.chart.${plot.name}`), plot.unit, ...words].filter(Boolean).join(" ");
  }

  function rows() {
    return plots.flatMap((plot, p) => plot.lines.map((line, i) => ({ name: labelOf(line), unit: plot.unit, digits: plot.digits, column: shown[p]?.[i + 1] ?? [] })));
  }

  /** Fields and readings have times of their own: a row has what is known of its time. */
  function file() {
    const all = columns();
    const names = plots.flatMap((plot) => plot.lines.map((line) => line.column));
    /** @type {Map<number, (number | null)[]>} */
    const at = new Map();
    let place = 0;
    plots.forEach((plot, p) => {
      all[p][0].forEach((time, i) => {
        const row = at.get(Number(time)) ?? Array(names.length).fill(null);
        plot.lines.forEach((_, k) => (row[place + k] = all[p][k + 1][i]));
        at.set(Number(time), row);
      });
      place += plot.lines.length;
    });
    const lines = [...at].sort(([a], [b]) => a - b);
    return { name: "live.csv", names: ["time_unix_s", ...names], columns: [lines.map(([time]) => time), ...names.map((_, k) => lines.map(([, row]) => row[k]))] };
  }

  return {
    end() {
      feed.end();
      plots.forEach((plot) => plot.chart.end());
    },
  };
}

/** @typedef {(sample: Sample) => number | null} Value */

/**
 * @typedef {object} Plot
 * @property {string} name
 * @property {string} unit
 * @property {number} digits
 * @property {[number, number]} [least]
 * @property {{name: string, column: string}[]} lines
 * @property {(pair: number) => Value[]} [picks] of a field; without them the lines are channels
 */

/** @param {string[]} channels @returns {Plot} */
function vacuumOf(channels) {
  return { name: "vacuum", unit: "kPa", digits: 1, least: [0, 45], lines: channels.map((name) => ({ name, column: `${name}_kpa` })) };
}

/** @param {...Value} picks @returns {(pair: number) => Value[]} */
const fixed = (...picks) => () => picks;

/** @type {Plot[]} */
const PLOTS = [
  {
    name: "targets", unit: "", digits: 0, least: [0, 10],
    lines: [{ name: "left", column: "targets_left" }, { name: "right", column: "targets_right" }, { name: "points", column: "points" }],
    picks: fixed((sample) => sample.left, (sample) => sample.right, (sample) => sample.points),
  },
  { name: "residual", unit: "px", digits: 3, least: [0, 0.2], lines: [{ name: "residual", column: "residual_px" }], picks: fixed((sample) => sample.residual_px) },
  { name: "latency", unit: "ms", digits: 1, least: [0, 10], lines: [{ name: "latency", column: "latency_ms" }], picks: fixed((sample) => sample.latency_ms) },
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
