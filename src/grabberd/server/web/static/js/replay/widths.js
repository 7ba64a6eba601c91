// The width of a capture's middle section, between targets that face each other. Nothing here touches the page.

/** @import { Grid } from "../scene/grid.js" */
/** @import { FieldPoints } from "types/documents" */

/** @typedef {Map<number, number>} Widths millimetres by the field's number */

const NEARLY = 0.9;

/** Targets that face each other in the middle row, the outermost first. @param {Grid} grid @returns {[number, number][]} ids */
export function facingOf(grid) {
  const rows = [...new Set(grid.row)].sort((a, b) => a - b);
  const middle = rows[Math.floor(rows.length / 2)];
  const ids = grid.target.map((id, i) => ({ id, row: grid.row[i], column: grid.column[i] })).filter((one) => one.row === middle).sort((a, b) => a.column - b.column).map(({ id }) => id);
  return Array.from({ length: Math.floor(ids.length / 2) }, (_, i) => [ids[i], ids[ids.length - 1 - i]]);
}

/** The width between the outermost pair that is seen nearly as often as any. @param {FieldPoints[]} fields @param {[number, number][]} pairs @returns {Widths} */
export function widthOf(fields, pairs) {
  const all = pairs.map(([one, other]) => widthsOf(fields, one, other));
  const most = Math.max(0, ...all.map((widths) => widths.size));
  return all.find((widths) => widths.size >= NEARLY * most) ?? new Map();
}

/** @param {FieldPoints[]} fields @param {number} one @param {number} other @returns {Widths} */
function widthsOf(fields, one, other) {
  /** @type {Widths} */
  const widths = new Map();
  for (const field of fields) {
    const [from, to] = [placeOf(field, one), placeOf(field, other)];
    if (from && to) widths.set(field.n, Math.hypot(...from.map((value, i) => value - to[i])));
  }
  return widths;
}

/** @param {FieldPoints} field @param {number} target */
function placeOf(field, target) {
  const i = field.target.indexOf(target);
  return i < 0 ? null : [field.x_mm[i], field.y_mm[i], field.z_mm[i]];
}
