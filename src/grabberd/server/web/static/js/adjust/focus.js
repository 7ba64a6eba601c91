// The sharpness of the targets' edges over the last two minutes, with its best value: to turn the lens by.
import { el, setText } from "../core/dom.js";
import { INKS, createChart } from "../plots/chart.js";
import { columnsOf } from "../plots/series.js";
import { bestOf, createTrend } from "./trend.js";

/** @import { Context } from "../core/context.js" */
/** @import { Illumination } from "types/documents" */
/** @import { Sample } from "./trend.js" */

const SPAN_S = 120;
const GAP_S = 1.5;
const DIGITS = 2;
const HEIGHT = 120;
const NAMES = /** @type {const} */ (["left", "right"]);

/** @param {Context} context */
export function createFocus(context) {
  const { t, format } = context;
  const trend = createTrend(SPAN_S);
  const when = (/** @type {number} */ s) => t("live.curves.when", { s: format.number(s) });
  const lines = NAMES.map((name, i) => ({ label: t(`live.view.${name}`), ink: INKS[i], dash: i ? [7, 4] : undefined }));
  const chart = createChart(context, { title: t("live.focus.title"), unit: "", digits: DIGITS, lines, when, over: [-SPAN_S, 0], least: [0, 0.5], height: HEIGHT });
  const words = NAMES.map((name) => el("p", { class: "focus-words number", data: { focus: name } }));
  const again = el("button", { class: "button", type: "button", data: { do: "focus-again" }, on: { click: restart } }, t("live.focus.again"));
  const element = el("div", { class: "focus" }, el("div", { class: "row between" }, el("div", { class: "grow" }, words), again), chart.element, el("p", { class: "field-hint" }, t("live.focus.hint")));

  function restart() {
    trend.clear();
    show();
  }

  function show() {
    const now_s = performance.now() / 1000;
    const samples = trend.samples();
    NAMES.forEach((name, i) => setText(words[i], wordsOf(name, samples, now_s)));
    const ago = samples.map((one) => ({ ...one, time_s: one.time_s - now_s }));
    chart.set(columnsOf(ago, NAMES.map((name) => (one) => one[name]), GAP_S), words.map((one) => one.textContent).join(" "));
  }

  /** @param {typeof NAMES[number]} name @param {Sample[]} samples @param {number} now_s */
  function wordsOf(name, samples, now_s) {
    const view = t(`live.view.${name}`);
    const best = bestOf(samples, name);
    const now = samples.at(-1)?.[name] ?? null;
    if (!best) return t("live.focus.none", { view });
    const values = { view, best: format.number(best.value, DIGITS), now: format.number(now, DIGITS), ago: format.duration(now_s - best.time_s) };
    return t(now !== null && now >= best.value ? "live.focus.isBest" : "live.focus.words", values);
  }

  return {
    element,
    /** @param {Illumination | null} light null: there is none at this moment */
    show(light) {
      trend.add({ time_s: performance.now() / 1000, left: light?.views.left?.sharpness ?? null, right: light?.views.right?.sharpness ?? null });
      show();
    },
    unmount: chart.end,
  };
}
