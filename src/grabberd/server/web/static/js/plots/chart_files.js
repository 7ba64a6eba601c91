// A chart taken home: as a picture for paper, as a table with all of its numbers.
import uPlot from "../../vendor/uplot/uPlot.esm.js";
import { el } from "../core/dom.js";
import { aligned, coloursAt, drawingOf } from "./drawing.js";
import { csvOf } from "./series.js";

/** @import { Format } from "../core/format.js" */
/** @import { Options } from "./chart.js" */
/** @import { Colours } from "./drawing.js" */
/** @import { Column } from "./series.js" */

const WIDTH = 1600;
const HEIGHT = 760;
const TIMES = 1.8;
const EDGE = 28;
const HEAD = 74;
const ROW = 40;

/**
 * The chart as it is shown, but light, whatever the page is: it goes on paper.
 * @param {HTMLElement} host an element of the page, for a moment
 * @param {Options} options
 * @param {Format} format
 * @param {{columns: Column[], shown: boolean[], range: [number, number] | null}} state
 * @returns {Promise<Blob | null>}
 */
export async function pictureOf(host, options, format, { columns, shown, range }) {
  const probe = el("div", { class: "chart-print" });
  host.append(probe);
  const colours = coloursAt(probe);
  // In these pixels: uPlot multiplies by the screen's, and a picture has the same size everywhere.
  const dense = devicePixelRatio || 1;
  const plot = new uPlot(drawingOf(options, format, colours, { width: WIDTH / dense, height: HEIGHT / dense, times: TIMES / dense, range: () => range }), aligned(columns), probe);
  shown.forEach((isShown, i) => isShown || plot.setSeries(i + 1, { show: false }));
  if (options.band && !shown[0]) for (const edge of [1, 2]) plot.setSeries(shown.length + edge, { show: false });
  await new Promise((resolve) => setTimeout(resolve)); // uPlot draws when the present task has ended
  const picture = framed(plot.ctx.canvas, options, colours, options.lines.filter((_, i) => shown[i]));
  plot.destroy();
  probe.remove();
  return new Promise((resolve) => picture.toBlob(resolve, "image/png"));
}

/** With title, axes in words and legend. @param {HTMLCanvasElement} drawing @param {Options} options @param {Colours} colours @param {Options["lines"]} lines */
function framed(drawing, options, colours, lines) {
  const canvas = document.createElement("canvas");
  const pen = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  const places = rowsOf(pen, lines, drawing.width - 2 * EDGE);
  const rows = Math.max(0, ...places.map(({ row }) => row)) + 1;
  canvas.width = drawing.width;
  canvas.height = HEAD + drawing.height + ROW + rows * ROW + EDGE;
  pen.fillStyle = colours.ground;
  pen.fillRect(0, 0, canvas.width, canvas.height);
  pen.drawImage(drawing, 0, HEAD);
  pen.textBaseline = "middle";
  pen.fillStyle = colours.ink;
  pen.font = "600 32px system-ui, sans-serif";
  pen.fillText([options.title, options.unit].filter(Boolean).join(", "), EDGE, HEAD / 2, canvas.width - 2 * EDGE);
  pen.font = LETTERS;
  pen.textAlign = "right";
  pen.fillText(options.x?.label ?? "", canvas.width - EDGE, HEAD + drawing.height + ROW / 2);
  pen.textAlign = "left";
  for (const { line, x, row } of places) drawEntry(pen, line, colours, x, HEAD + drawing.height + ROW + row * ROW + ROW / 2);
  return canvas;
}

const LETTERS = "24px system-ui, sans-serif";
const SWATCH = 56;

/** Where each entry of the legend stands. @param {CanvasRenderingContext2D} pen @param {Options["lines"]} lines @param {number} room */
function rowsOf(pen, lines, room) {
  pen.font = LETTERS;
  let [x, row] = [EDGE, 0];
  return lines.map((line) => {
    const width = SWATCH + 12 + pen.measureText(line.label).width + 36;
    if (x > EDGE && x + width > EDGE + room) [x, row] = [EDGE, row + 1];
    const place = { line, x, row };
    x += width;
    return place;
  });
}

/** @param {CanvasRenderingContext2D} pen @param {Options["lines"][number]} line @param {Colours} colours @param {number} x @param {number} y */
function drawEntry(pen, line, colours, x, y) {
  pen.strokeStyle = colours[line.ink];
  pen.lineWidth = 4;
  pen.setLineDash((line.dash ?? []).map((part) => part * TIMES));
  pen.beginPath();
  pen.moveTo(x, y);
  pen.lineTo(x + SWATCH, y);
  pen.stroke();
  pen.fillStyle = colours.ink;
  pen.fillText(line.label, x + SWATCH + 12, y);
}

/** All numbers of a chart with their σ, also those out of sight. @param {Options} options @param {Column[]} columns @param {Column[]} sigmas */
export function tableOf(options, columns, sigmas) {
  const names = options.lines.map((line) => line.column ?? [line.label, options.unit].map(slug).filter(Boolean).join("_"));
  const named = options.lines.flatMap((_, i) => [
    { name: names[i], values: columns[i + 1] },
    ...(sigmas[i]?.some((value) => value !== null && value !== undefined) ? [{ name: `sigma_${names[i]}`, values: sigmas[i] }] : []),
  ]);
  // A gap is a row in the drawing alone.
  const kept = columns[0].map((_, row) => row).filter((row) => named.some(({ values }) => values[row] !== null && values[row] !== undefined));
  const pick = (/** @type {Column} */ values) => kept.map((row) => values[row] ?? null);
  return csvOf([options.x?.name ?? "time_s", ...named.map(({ name }) => name)], [pick(columns[0]), ...named.map(({ values }) => pick(values))]);
}

/** @param {string} text */
const slug = (text) => text.toLowerCase().replace(/[^\p{L}\p{N}]+/gu, "_").replace(/^_|_$/g, "");
