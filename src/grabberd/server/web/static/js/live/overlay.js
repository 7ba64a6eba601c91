// Overlay of the live picture: both views' outlines, the located targets, their ids and residuals.

/** @import { Point, Preview } from "./message.js" */
/** @import { Views } from "types/documents" */

/** @type {Record<string, string>} */
const COLOURS = { left: "#35d0ff", right: "#ffb02e" };
const RING_PX = 7;
const LARGEST_LABEL_PX = 12;
const GOOD_PX = 0.15;
const FAIR_PX = 0.3;

/**
 * @typedef {object} Choices
 * @property {boolean} ids
 * @property {boolean} residuals
 */

/** @typedef {Pick<Preview, "frame" | "centroids" | "points">} Found */

/**
 * @param {CanvasRenderingContext2D} to scaled to frame pixels, from the frame's corner
 * @param {Found} found
 * @param {Views} views
 * @param {Choices} choices
 * @param {number} unit how many frame pixels one pixel of the page is
 */
export function drawOverlay(to, found, views, choices, unit) {
  for (const [name, view] of Object.entries(views)) outline(to, view, found.frame.lines, colourOf(name), unit);
  to.translate(0.5, 0.5); // places count from the middle of the first pixel
  if (choices.residuals) for (const point of found.points) ringPoint(to, point, unit);
  else ringAll(to, found.centroids, views, unit);
  if (choices.ids) for (const point of found.points) label(to, point, unit);
}

/** @param {string} name */
export function colourOf(name) {
  return COLOURS[name] ?? "#ffffff";
}

/** @param {number} residual_px */
export function residualColour(residual_px) {
  if (residual_px <= GOOD_PX) return "#5fe39a";
  return residual_px <= FAIR_PX ? "#ffd54a" : "#ff7a6e";
}

/** @param {CanvasRenderingContext2D} to @param {Views[string]} view @param {number} lines @param {string} colour @param {number} unit */
function outline(to, view, lines, colour, unit) {
  to.strokeStyle = colour;
  to.lineWidth = 2 * unit;
  to.strokeRect(view.first_column + unit, unit, view.end_column - view.first_column - 2 * unit, lines - 2 * unit);
}

/** @param {CanvasRenderingContext2D} to @param {Float32Array} centroids @param {Views} views @param {number} unit */
function ringAll(to, centroids, views, unit) {
  for (const [name, view] of Object.entries(views)) {
    to.beginPath();
    for (let i = 0; i < centroids.length; i += 2) {
      const [x, y] = [centroids[i], centroids[i + 1]];
      if (x >= view.first_column && x < view.end_column) circle(to, x, y);
    }
    to.strokeStyle = colourOf(name);
    to.lineWidth = 1.6 * unit;
    to.stroke();
  }
}

/** @param {CanvasRenderingContext2D} to @param {Point} point @param {number} unit */
function ringPoint(to, { image, residual }, unit) {
  to.beginPath();
  circle(to, image[0], image[1]);
  circle(to, image[2], image[3]);
  to.strokeStyle = residualColour(residual);
  to.lineWidth = 2.2 * unit;
  to.stroke();
}

/** @param {CanvasRenderingContext2D} to @param {number} x @param {number} y */
function circle(to, x, y) {
  to.moveTo(x + RING_PX, y);
  to.arc(x, y, RING_PX, 0, 2 * Math.PI);
}

/** @param {CanvasRenderingContext2D} to @param {Point} point @param {number} unit */
function label(to, { image, target }, unit) {
  to.font = `600 ${Math.min(11 * unit, LARGEST_LABEL_PX)}px system-ui, sans-serif`;
  to.textAlign = "center";
  to.lineWidth = 3 * unit;
  to.strokeStyle = "#000";
  to.fillStyle = "#fff";
  for (const at of [0, 2]) {
    to.strokeText(String(target), image[at], image[at + 1] - RING_PX - 2 * unit);
    to.fillText(String(target), image[at], image[at + 1] - RING_PX - 2 * unit);
  }
}
