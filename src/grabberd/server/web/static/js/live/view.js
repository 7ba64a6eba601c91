// Which part of the frame is shown: all of it, or what somebody has zoomed in on. Nothing here touches the page.

export const MOST_ZOOM = 12;
/** The daemon is asked for whole blocks, so that a small shift asks for nothing new. */
const BLOCK = 8;

/**
 * @typedef {object} View
 * @property {number} x frame pixels that lie to the left
 * @property {number} y frame lines that lie above
 * @property {number} zoom 1: the whole frame
 *
 * @typedef {{columns: number, lines: number}} Frame
 */

/** @type {View} */
export const WHOLE = { x: 0, y: 0, zoom: 1 };

/** A view that lies within the frame. @param {View} view @param {Frame} frame @returns {View} */
function within({ x, y, zoom }, { columns, lines }) {
  const held = Math.min(Math.max(zoom, 1), MOST_ZOOM);
  const most = 1 - 1 / held;
  return { x: Math.min(Math.max(x, 0), most * columns), y: Math.min(Math.max(y, 0), most * lines), zoom: held };
}

/** Closer by a factor, with what lies at a place of the frame staying where it is. @param {View} view @param {number} factor @param {{x: number, y: number}} at @param {Frame} frame */
export function zoomed(view, factor, at, frame) {
  const zoom = Math.min(Math.max(view.zoom * factor, 1), MOST_ZOOM);
  const share = view.zoom / zoom;
  return within({ x: at.x - (at.x - view.x) * share, y: at.y - (at.y - view.y) * share, zoom }, frame);
}

/** Shifted by frame pixels. @param {View} view @param {number} x @param {number} y @param {Frame} frame */
export function shifted(view, x, y, frame) {
  return within({ ...view, x: view.x + x, y: view.y + y }, frame);
}

/** With a place of the frame in its middle. @param {{x: number, y: number}} at @param {number} zoom @param {Frame} frame */
export function centred({ x, y }, zoom, frame) {
  return within({ x: x - frame.columns / zoom / 2, y: y - frame.lines / zoom / 2, zoom }, frame);
}

/** The middle of a view. @param {View} view @param {Frame} frame */
export function middleOf(view, frame) {
  return { x: view.x + frame.columns / view.zoom / 2, y: view.y + frame.lines / view.zoom / 2 };
}

/** The part of the frame that a view needs; null for all of it. @param {View} view @param {Frame} frame */
export function partOf(view, frame) {
  if (view.zoom <= 1) return null;
  const x = Math.floor(view.x / BLOCK) * BLOCK;
  const y = Math.floor(view.y / BLOCK) * BLOCK;
  const end = (/** @type {number} */ start, /** @type {number} */ size, /** @type {number} */ most) => Math.min(Math.ceil((start + size) / BLOCK) * BLOCK, most);
  return { x, y, columns: end(view.x, frame.columns / view.zoom, frame.columns) - x, lines: end(view.y, frame.lines / view.zoom, frame.lines) - y };
}
