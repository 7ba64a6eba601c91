// How a chart is drawn by uPlot: its axes, lines, bands and colours.
import { css } from "../scene/colours.js";
import { digitsOf } from "../scene/scale.js";
import { coloursOf } from "../scene/theme.js";

/** @import uPlot from "../../vendor/uplot/uPlot.esm.js" */
/** @import { Format } from "../core/format.js" */
/** @import { Options } from "./chart.js" */
/** @import { Column } from "./series.js" */

/** @typedef {"1" | "2" | "3" | "4" | "5" | "6"} Ink */

/** @type {Ink[]} the plots' colours; three are enough for most */
export const INKS = ["1", "2", "3", "4", "5", "6"];
const TOKENS = { ground: "surface", ink: "ink", muted: "muted", line: "line", 1: "plot-1", 2: "plot-2", 3: "plot-3", 4: "plot-4", 5: "plot-5", 6: "plot-6" };

/** @typedef {Record<keyof typeof TOKENS, string>} Colours as CSS */

/** The colours that hold there. @param {HTMLElement} element @returns {Colours} */
export function coloursAt(element) {
  const found = Object.entries(coloursOf(element, TOKENS)).map(([name, rgb]) => [name, css(rgb)]);
  return Object.fromEntries(found);
}

/**
 * @param {Options} options
 * @param {Format} format
 * @param {Colours} colours
 * @param {{width: number, height: number, times?: number, range: () => [number, number] | null}} size times: of letters and lines
 * @returns {uPlot.Options}
 */
export function drawingOf(options, format, colours, { width, height, times = 1, range }) {
  const edge = { label: "", stroke: "transparent", width: 0, points: { show: false }, spanGaps: false };
  const count = options.lines.length;
  /** @param {Options["lines"][number]} one @returns {uPlot.Series} */
  const line = (one) => ({ label: one.label, stroke: colours[one.ink], width: 2 * times, dash: one.dash?.map((part) => part * times), spanGaps: options.joined ?? false, points: { size: 5 * times } });
  /** @type {uPlot.Band} */
  const band = { series: [count + 1, count + 2], fill: faint(colours[options.lines[0]?.ink ?? "1"]) };
  const axis = { stroke: colours.muted, grid: { stroke: colours.line, width: times }, ticks: { stroke: colours.line, width: times }, font: `${13 * times}px system-ui, sans-serif` };
  return {
    width, height, legend: { show: false },
    cursor: { y: false, drag: { x: false, y: false, setScale: false }, points: { size: 9 } },
    scales: { x: { time: false, range: (_, low, high) => range() ?? options.over ?? spanOf(low, high) }, y: { range: (_, low, high) => rangeOf(low, high, options.least) } },
    series: [{}, ...options.lines.map(line), ...(options.band ? [edge, edge] : [])],
    bands: options.band ? [band] : [],
    axes: [
      { ...axis, space: 90 * times, size: 34 * times, values: (_, marks) => marks.map(options.when) },
      { ...axis, size: 58 * times, values: (_, marks) => marks.map((mark) => format.number(mark, digitsOf(marks))) },
    ],
  };
}

/** Columns as uPlot takes them: every time is known, values may be missing. @param {Column[]} columns */
export const aligned = (columns) => /** @type {uPlot.AlignedData} */ (columns);

/** Room above and below, and never less than a least range. @param {number | null} low @param {number | null} high @param {[number, number]} [least] @returns {[number, number]} */
export function rangeOf(low, high, least) {
  const [a, b] = [low ?? 0, high ?? 1];
  const room = Math.max((b - a) * 0.08, 1e-3 * Math.abs(b), 1e-6);
  return [Math.min(a - room, least?.[0] ?? Infinity), Math.max(b + room, least?.[1] ?? -Infinity)];
}

/** A span that can be drawn, also of a single value. @param {number | null} low @param {number | null} high @returns {[number | null, number | null]} */
const spanOf = (low, high) => (low !== null && low === high ? [low - 0.5, low + 0.5] : [low, high]);

/** @param {string} colour "rgb(1 2 3)" */
const faint = (colour) => colour.replace(")", " / 28%)");
