// The vacuum below the wall's movement, over the last seconds; without a logger, the wall alone while it is captured.
import { el, fill, symbol } from "../core/dom.js";
import { deviceOf, rateOf } from "../core/store.js";
import { INKS, createChart } from "../plots/chart.js";
import { pairOf } from "../plots/facing_pair.js";
import { columnsOf, summaryOf } from "../plots/series.js";
import { followCurves } from "./curves_feed.js";
import { loggersOf } from "./curves_message.js";

/** @import { Context } from "../core/context.js" */
/** @import { Known } from "../core/store.js" */
/** @import { Column } from "../plots/series.js" */
/** @import { Curves, LoggerHere } from "./curves_message.js" */

export const SPAN_S = 10;
const HEIGHT = 110;
/** A logger may say something as seldom as this. */
export const LOGGER_GAP_S = 0.5;
const DASHES = [undefined, [7, 4], [2, 4], [12, 4, 2, 4]];

/** @param {Context} context */
export function createCurves(context) {
  const { t, store } = context;
  const element = el("section", { class: "curves", "aria-label": t("live.curves.title"), hidden: true });
  /** @type {ReturnType<typeof createPair> | null} */
  let pair = null;

  const runs = (/** @type {Known} */ known) => Boolean(deviceOf(known)?.capture_id);
  const key = (/** @type {Known} */ known) => JSON.stringify([deviceOf(known)?.name, runs(known), loggersOf(known.state, deviceOf(known)?.name)]);
  const end = store.subscribe(key, (_, known) => {
    const loggers = loggersOf(known.state, deviceOf(known)?.name);
    const shows = loggers.length > 0 || runs(known);
    const names = shows ? loggers.flatMap((one) => one.channels).join() : null;
    element.hidden = !shows;
    if ((pair?.names ?? null) !== names) {
      pair?.end();
      pair = names === null ? null : createPair(context, loggers, names);
      fill(element, pair ? [pair.element] : []);
    }
    pair?.tell(loggers);
  });

  return {
    element,
    unmount() {
      end();
      pair?.end();
    },
  };
}

/** @param {Context} context @param {LoggerHere[]} loggers @param {string} names of their channels */
function createPair(context, loggers, names) {
  const { t, texts, format, store } = context;
  const channels = loggers.flatMap((one) => one.channels);
  const when = (/** @type {number} */ s) => t("live.curves.when", { s: format.number(s, Number.isInteger(s) ? 0 : 1) });
  const shared = { when, together: "curves", over: /** @type {[number, number]} */ ([-SPAN_S, 0]), height: HEIGHT };
  const labels = channels.map((one) => (texts.has(`live.curves.channel.${one}`) ? t(`live.curves.channel.${one}`) : one));
  const wall = { title: t("live.curves.wall"), unit: "mm", digits: 2, labels: [t("live.curves.width")] };
  const vacuum = { title: t("live.curves.vacuum"), unit: "kPa", digits: 1, labels };
  const charts = (channels.length ? [wall, vacuum] : [wall]).map((one) => ({ ...one, chart: createChart(context, { ...shared, ...one, lines: one.labels.map(lineOf), least: one === vacuum ? [0, 45] : undefined }) }));
  const faults = el("div", { class: "stack curves-faults", role: "status" });
  const element = el("div", { class: "stack" }, charts.map(({ chart }) => chart.element), faults);
  const feed = followCurves(context, SPAN_S, draw);

  /** @param {Curves} known */
  function draw(known) {
    const place = pairOf(known.fields);
    /** @template {{time_s: number}} T @param {T} one @returns {T} */
    const ago = (one) => ({ ...one, time_s: one.time_s - known.now_s });
    show(0, columnsOf(known.fields.map(ago), [(one) => one.widths[place]?.width_mm], gapOf(rateOf(deviceOf(store.get())))));
    if (channels.length) show(1, columnsOf(known.readings.map(ago), channels.map((name) => (one) => one.kpa[name]), LOGGER_GAP_S));
  }

  /** @param {number} which @param {Column[]} columns */
  function show(which, columns) {
    const { chart, title, unit, digits, labels: names } = charts[which];
    const number = (/** @type {number} */ value) => format.number(value, digits);
    const words = names.map((name, i) => {
      const summary = summaryOf(columns[i + 1]);
      return summary && t("plots.words", { name, last: number(summary.last), least: number(summary.least), greatest: number(summary.greatest) });
    });
    chart.set(columns, [title, unit, ...words].filter(Boolean).join(" "));
  }

  return {
    element, names,
    /** Which of them give nothing, and why. @param {LoggerHere[]} now */
    tell(now) {
      const silent = now.filter((one) => one.cause);
      const words = silent.map((one) => t("live.curves.silent", { logger: one.name, cause: one.cause ?? "" }));
      if (words.join() === faults.textContent) return;
      fill(faults, words.map((text) => el("p", { class: "note is-bad" }, symbol("bad"), el("span", { class: "grow" }, text))));
    },
    end() {
      feed.end();
      for (const { chart } of charts) chart.end();
    },
  };
}

/** A field that was not measured is a gap. @param {number} rate_hz */
export const gapOf = (rate_hz) => 1.5 / rate_hz;

/** @param {string} label @param {number} i */
const lineOf = (label, i) => ({ label, ink: INKS[i % INKS.length], dash: DASHES[i % DASHES.length] });
