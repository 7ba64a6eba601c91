// The view as a PNG picture, with its legend and its words.
import { marksOf, stepsOf } from "./legend.js";

/** @import { Scale } from "./scale.js" */

const FOOT = 84;
const EDGE = 16;

/**
 * @typedef {object} Caption
 * @property {string} words what is shown
 * @property {string} legend quantity and unit
 * @property {Scale | null} scale
 * @property {(value: number, digits: number) => string} number
 * @property {Record<"ground" | "ink", string>} colours as CSS
 */

/**
 * @param {HTMLCanvasElement} view drawn just now
 * @param {Caption} caption
 * @returns {Promise<Blob | null>}
 */
export function pictureOf(view, caption) {
  const factor = view.width / Math.max(1, view.clientWidth);
  const canvas = document.createElement("canvas");
  canvas.width = view.width;
  canvas.height = view.height + FOOT * factor;
  const pen = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  pen.fillStyle = caption.colours.ground;
  pen.fillRect(0, 0, canvas.width, canvas.height);
  pen.drawImage(view, 0, 0);
  pen.scale(factor, factor);
  drawFoot(pen, caption, view.clientWidth, view.clientHeight);
  return new Promise((resolve) => canvas.toBlob(resolve, "image/png"));
}

/** @param {CanvasRenderingContext2D} pen @param {Caption} caption @param {number} width @param {number} top */
function drawFoot(pen, caption, width, top) {
  pen.fillStyle = caption.colours.ink;
  pen.font = "13px system-ui, sans-serif";
  pen.textBaseline = "middle";
  pen.fillText(caption.words, EDGE, top + FOOT - 14, width - 2 * EDGE);
  if (caption.scale) drawLegend(pen, caption, caption.scale, width, top);
}

/** @param {CanvasRenderingContext2D} pen @param {Omit<Caption, "words" | "scale">} caption @param {Scale} scale @param {number} width @param {number} top */
export function drawLegend(pen, caption, scale, width, top) {
  const long = Math.min(420, width - 2 * EDGE);
  const colours = stepsOf(scale.map);
  const ramp = pen.createLinearGradient(EDGE, 0, EDGE + long, 0);
  colours.forEach((colour, i) => ramp.addColorStop(i / (colours.length - 1), colour));
  pen.fillText(caption.legend, EDGE, top + 8);
  pen.fillStyle = ramp;
  pen.fillRect(EDGE, top + 20, long, 12);
  pen.fillStyle = caption.colours.ink;
  for (const { at, text } of marksOf(scale, caption.number)) {
    pen.textAlign = at < 0.05 ? "left" : at > 0.95 ? "right" : "center";
    pen.fillText(text, EDGE + at * long, top + 44);
  }
  pen.textAlign = "left";
}

/** Has the browser save it. @param {Blob} blob @param {string} name */
export function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000); // the browser reads it after the click has returned
}
