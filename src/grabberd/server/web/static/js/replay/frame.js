// A frame of a film: the panes that are seen, side by side as on the screen, on one canvas.
import { colourAt, css } from "../scene/colours.js";
import { drawLegend } from "../scene/picture.js";
import { shareOf } from "../scene/scale.js";

/** @import { Scale } from "../scene/scale.js" */

const HEAD = 34;
const EDGE = 10;
const LEGEND = 64;
const FONT = "system-ui, sans-serif";

/**
 * @typedef {{x: number, y: number, width: number, height: number}} Box
 * @typedef {(pen: CanvasRenderingContext2D, box: Box, look: Look) => void} Draw
 *
 * @typedef {object} Look
 * @property {string} ground
 * @property {string} ink
 * @property {string} accent
 * @property {(value: number, digits: number) => string} number
 */

/**
 * @param {CanvasRenderingContext2D} pen
 * @param {string} caption
 * @param {{title: string, draw: Draw}[]} panes one, or up to four
 * @param {Look} look
 */
export function drawFrame(pen, caption, panes, look) {
  const { width, height } = pen.canvas;
  pen.fillStyle = look.ground;
  pen.fillRect(0, 0, width, height);
  write(pen, caption, EDGE, HEAD / 2, look.ink, `600 18px ${FONT}`, width - 2 * EDGE);
  const across = panes.length > 1 ? 2 : 1;
  const [w, h] = [width / across, (height - HEAD) / Math.ceil(panes.length / across)];
  panes.forEach(({ title, draw }, i) => {
    const [x, y] = [(i % across) * w, HEAD + Math.floor(i / across) * h];
    const room = i % across === 0 && i === panes.length - 1 ? width : w; // the last of three has the whole row
    write(pen, title, x + EDGE, y + 12, look.ink, `600 15px ${FONT}`, room - 2 * EDGE);
    pen.save();
    draw(pen, { x: x + EDGE, y: y + 26, width: room - 2 * EDGE, height: h - 26 - EDGE }, look);
    pen.restore();
  });
}

/** A canvas, as large as it fits, and words over it. @param {HTMLCanvasElement} canvas @param {string} [words] @returns {Draw} */
export const drawnCanvas = (canvas, words = "") => (pen, box) => {
  const at = fitted(canvas, box);
  if (canvas.width && canvas.height) pen.drawImage(canvas, at.x, at.y, at.width, at.height);
  if (!words) return;
  pen.fillStyle = "rgb(10 14 16 / 88%)";
  pen.fillRect(at.x, at.y + at.height - 36, at.width, 36);
  write(pen, words, at.x + EDGE, at.y + at.height - 18, "#fff", `600 14px ${FONT}`, at.width - 2 * EDGE);
};

/** A canvas with the legend of its colours. @param {{canvas: HTMLCanvasElement, legend: string, scale: Scale | null}} picture @returns {Draw} */
export const drawnWall = ({ canvas, legend, scale }) => (pen, box, look) => {
  drawnCanvas(canvas)(pen, { ...box, height: box.height - (scale ? LEGEND : 0) }, look);
  writeLegend(pen, box, legend, scale, look);
};

/** @typedef {{canvas: HTMLCanvasElement | null, over: Element | null, title: string, share: number}} Chart */

/** Charts below each other, each with its playhead. @param {Chart[]} charts @returns {Draw} */
export const drawnCharts = (charts) => (pen, box, look) => {
  const high = box.height / Math.max(1, charts.length);
  charts.forEach(({ canvas, over, title, share }, i) => {
    if (!canvas?.clientWidth || !over) return;
    const top = box.y + i * high;
    write(pen, title, box.x, top + 9, look.ink, `13px ${FONT}`, box.width);
    const at = { ...fitted(canvas, { ...box, height: high - 20 }), y: top + 18 };
    pen.drawImage(canvas, at.x, at.y, at.width, at.height);
    const scale = at.width / canvas.clientWidth;
    const { offsetLeft, offsetTop, offsetWidth, offsetHeight } = /** @type {HTMLElement} */ (over);
    pen.fillStyle = look.accent;
    pen.fillRect(at.x + scale * (offsetLeft + share * offsetWidth) - 1, at.y + scale * offsetTop, 2, scale * offsetHeight);
  });
};

/**
 * @typedef {object} MapPicture
 * @property {{row: number[], column: number[]}} columns
 * @property {(number | null)[]} values
 * @property {Scale | null} scale
 * @property {string} legend
 * @property {string} words
 */

/** A map with its legend; a cell without a value is grey. @param {MapPicture} picture @returns {Draw} */
export const drawnMap = ({ columns, values, scale, legend, words }) => (pen, box, look) => {
  const [across, down] = [Math.max(...columns.column) + 1, Math.max(...columns.row) + 1];
  const size = Math.min(box.width / (across * 10), (box.height - LEGEND - 22) / (down * 6));
  const left = box.x + (box.width - size * across * 10) / 2;
  values.forEach((value, i) => {
    pen.fillStyle = value === null || !scale ? "rgb(128 128 128 / 40%)" : css(colourAt(scale.map, shareOf(scale, value)));
    pen.fillRect(left + columns.column[i] * 10 * size, box.y + columns.row[i] * 6 * size, 10 * size + 0.5, 6 * size + 0.5);
  });
  write(pen, words, box.x, box.y + down * 6 * size + 12, look.ink, `13px ${FONT}`, box.width);
  writeLegend(pen, box, legend, scale, look);
};

/** @param {string} words @returns {Draw} */
export const drawnWords = (words) => (pen, box, look) => write(pen, words, box.x, box.y + 20, look.ink, `14px ${FONT}`, box.width);

/** @param {CanvasRenderingContext2D} pen @param {Box} box @param {string} legend @param {Scale | null} scale @param {Look} look */
function writeLegend(pen, box, legend, scale, look) {
  if (!scale) return;
  pen.save();
  pen.translate(box.x, box.y + box.height - LEGEND);
  pen.font = `13px ${FONT}`;
  pen.textBaseline = "middle";
  pen.fillStyle = look.ink;
  drawLegend(pen, { legend, number: look.number, colours: look }, scale, box.width, 4);
  pen.restore();
}

/** @param {CanvasRenderingContext2D} pen @param {string} words @param {number} x @param {number} y @param {string} colour @param {string} font @param {number} room */
function write(pen, words, x, y, colour, font, room) {
  pen.fillStyle = colour;
  pen.font = font;
  pen.textBaseline = "middle";
  pen.fillText(words, x, y, room);
}

/** @param {HTMLCanvasElement} canvas @param {Box} box @returns {Box} */
function fitted({ width, height }, box) {
  const scale = Math.min(box.width / Math.max(1, width), box.height / Math.max(1, height));
  const [w, h] = [width * scale, height * scale];
  return { x: box.x + (box.width - w) / 2, y: box.y + (box.height - h) / 2, width: w, height: h };
}
