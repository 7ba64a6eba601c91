// One chart over time: lines, a band of σ round one of them, a legend with the values under the pointer.
import uPlot from "../../vendor/uplot/uPlot.esm.js";
import { el, setText } from "../core/dom.js";
import { css } from "../scene/colours.js";
import { digitsOf } from "../scene/scale.js";
import { coloursOf, onTheme } from "../scene/theme.js";

/** @import { Context } from "../core/context.js" */
/** @import { Column } from "./series.js" */

/** @typedef {"1" | "2" | "3"} Ink */

/**
 * @typedef {object} Line
 * @property {string} label
 * @property {Ink} ink one of the plots' colours
 * @property {number[]} [dash]
 */

/**
 * @typedef {object} Options
 * @property {string} title
 * @property {string} unit
 * @property {number} digits after the point
 * @property {Line[]} lines
 * @property {boolean} [band] the last two columns are the band round the first line
 * @property {(x: number) => string} when a time in words
 * @property {string} [together] charts of this name have one pointer and one range
 * @property {(range: [number, number] | null) => void} [zoomed] null: all of it
 * @property {[number, number]} [least] the least range of values
 */

/** @type {Ink[]} */
export const INKS = ["1", "2", "3"];
const HEIGHT = 190;
const TOKENS = { muted: "muted", line: "line", 1: "plot-1", 2: "plot-2", 3: "plot-3" };

/** @param {Context} context @param {Options} options */
export function createChart({ format }, options) {
  const values = options.lines.map(() => el("span", { class: "number" }, "–"));
  const legend = el("ul", { class: "chart-legend" }, options.lines.map((line, i) => el("li", {}, swatch(line), line.label, " ", el("b", {}, values[i]))));
  const place = el("div", { class: "chart-place", role: "img", "aria-label": options.title });
  const heading = el("h2", {}, options.title, options.unit ? el("span", { class: "muted" }, ` ${options.unit}`) : null);
  const element = el("section", { class: "card chart" }, el("div", { class: "chart-head" }, heading, legend), place);
  /** @type {Column[]} */
  let data = [[], ...options.lines.map(() => []), ...(options.band ? [[], []] : [])];
  /** @type {uPlot | null} */
  let plot = null;

  function build() {
    const width = place.clientWidth;
    if (!width) return;
    const scale = plot?.scales.x;
    plot?.destroy();
    plot = new uPlot(optionsOf(width), aligned(data), place);
    if (options.zoomed && scale?.min != null && scale.max != null) plot.setScale("x", { min: scale.min, max: scale.max });
  }

  /** @param {number} width @returns {uPlot.Options} */
  function optionsOf(width) {
    const colours = Object.fromEntries(Object.entries(coloursOf(element, TOKENS)).map(([name, rgb]) => [name, css(rgb)]));
    const line = (/** @type {Line} */ one) => ({ label: one.label, stroke: colours[one.ink], width: 2, dash: one.dash, spanGaps: false, points: { size: 5 } });
    const edge = { label: "", stroke: "transparent", width: 0, points: { show: false }, spanGaps: false };
    const count = options.lines.length;
    /** @type {uPlot.Band} */
    const band = { series: [count + 1, count + 2], fill: faint(colours[options.lines[0].ink]) };
    const axis = { stroke: colours.muted, grid: { stroke: colours.line, width: 1 }, ticks: { stroke: colours.line, width: 1 }, font: "13px system-ui, sans-serif" };
    return {
      width, height: HEIGHT, legend: { show: false },
      cursor: { drag: { x: Boolean(options.zoomed), y: false }, sync: options.together ? { key: options.together } : undefined, points: { size: 9 } },
      scales: { x: { time: false }, y: { range: (_, low, high) => rangeOf(low, high, options.least) } },
      series: [{}, ...options.lines.map(line), ...(options.band ? [edge, edge] : [])],
      bands: options.band ? [band] : [],
      axes: [
        { ...axis, space: 90, size: 34, values: (_, marks) => marks.map(options.when) },
        { ...axis, size: 58, values: (_, marks) => marks.map((mark) => format.number(mark, digitsOf(marks))) },
      ],
      hooks: { setCursor: [tell], setSelect: [choose], setScale: [(_, key) => key === "x" && watchZoom()] },
    };
  }

  /** The values under the pointer, or the last. @param {uPlot} now */
  function tell(now) {
    const index = now.cursor.idx ?? data[0].length - 1;
    values.forEach((one, i) => setText(one, format.number(data[i + 1][index], options.digits)));
  }

  /** @param {uPlot} now */
  function choose(now) {
    if (now.select.width > 0) options.zoomed?.([now.posToVal(now.select.left, "x"), now.posToVal(now.select.left + now.select.width, "x")]);
  }

  function watchZoom() {
    const { min = NaN, max = NaN } = plot?.scales.x ?? {};
    const whole = data[0].length > 1 && min <= (data[0][0] ?? NaN) && max >= (data[0].at(-1) ?? NaN);
    if (whole) options.zoomed?.(null);
  }

  const sizes = new ResizeObserver(([entry]) => {
    if (!plot) build();
    else if (Math.abs(plot.width - entry.contentRect.width) > 1 && entry.contentRect.width) plot.setSize({ width: entry.contentRect.width, height: HEIGHT });
  });
  sizes.observe(place);
  const endTheme = onTheme(build);

  return {
    element,
    /** @param {Column[]} columns times first @param {string} words what they show */
    set(columns, words) {
      data = columns;
      place.setAttribute("aria-label", words);
      if (plot) plot.setData(aligned(columns));
      else build();
      if (plot) tell(plot);
    },
    end() {
      sizes.disconnect();
      endTheme();
      plot?.destroy();
    },
  };
}

/** Columns as uPlot takes them: every time is known, values may be missing. @param {Column[]} columns */
const aligned = (columns) => /** @type {uPlot.AlignedData} */ (columns);

/** Room above and below, and never less than a least range. @param {number | null} low @param {number | null} high @param {[number, number]} [least] @returns {[number, number]} */
export function rangeOf(low, high, least) {
  const [a, b] = [low ?? 0, high ?? 1];
  const room = Math.max((b - a) * 0.08, 1e-3 * Math.abs(b), 1e-6);
  return [Math.min(a - room, least?.[0] ?? Infinity), Math.max(b + room, least?.[1] ?? -Infinity)];
}

/** @param {string} colour "rgb(1 2 3)" */
const faint = (colour) => colour.replace(")", " / 28%)");

/** @param {Line} line */
const swatch = (line) => el("span", { class: `chart-swatch plot-${line.ink} ${line.dash ? "is-dashed" : ""}`, "aria-hidden": "true" });
