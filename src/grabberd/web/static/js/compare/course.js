// The movement in a capture: width of its middle section, or depth of one target. Nothing here touches the page.

/** @import { Grid } from "../scene/grid.js" */
/** @import { FieldPoints } from "types/documents" */

/** @typedef {Map<number, number>} Course millimetres by the field's number */

const BINS = 50;
const NEARLY = 0.9;

/** Targets that face each other in the middle row, the outermost first. @param {Grid} grid @returns {[number, number][]} ids */
export function facingOf(grid) {
  const rows = [...new Set(grid.row)].sort((a, b) => a - b);
  const middle = rows[Math.floor(rows.length / 2)];
  const ids = grid.target.map((id, i) => ({ id, row: grid.row[i], column: grid.column[i] })).filter((one) => one.row === middle).sort((a, b) => a.column - b.column).map(({ id }) => id);
  return Array.from({ length: Math.floor(ids.length / 2) }, (_, i) => [ids[i], ids[ids.length - 1 - i]]);
}

/** The width between the outermost pair that is seen nearly as often as any. @param {FieldPoints[]} fields @param {[number, number][]} pairs @returns {Course} */
export function widthOf(fields, pairs) {
  const courses = pairs.map((pair) => courseOf(fields, (place) => apart(place(pair[0]), place(pair[1]))));
  const most = Math.max(0, ...courses.map((course) => course.size));
  return courses.find((course) => course.size >= NEARLY * most) ?? new Map();
}

/** A target in the middle, which moves most. @param {Grid} grid */
export const middleOf = (grid) => facingOf(grid).at(-1)?.[0] ?? grid.target[0];

/** The z of one target. @param {FieldPoints[]} fields @param {number} target @returns {Course} */
export function depthOf(fields, target) {
  return courseOf(fields, (place) => place(target)?.[2] ?? null);
}

/** @param {FieldPoints[]} fields @param {(place: (target: number) => number[] | null) => number | null} pick @returns {Course} */
function courseOf(fields, pick) {
  /** @type {Course} */
  const course = new Map();
  for (const field of fields) {
    const value = pick((target) => placeOf(field, target));
    if (value !== null) course.set(field.n, value);
  }
  return course;
}

/** @param {FieldPoints} field @param {number} target */
function placeOf(field, target) {
  const i = field.target.indexOf(target);
  return i < 0 ? null : [field.x_mm[i], field.y_mm[i], field.z_mm[i]];
}

/** @param {number[] | null} one @param {number[] | null} other */
function apart(one, other) {
  return one && other ? Math.hypot(...one.map((value, i) => value - other[i])) : null;
}

/**
 * Courses side by side, field by field from the first on.
 * @param {Course[]} courses
 * @param {number} field_s
 */
export function overTime(courses, field_s) {
  const end = Math.max(-1, ...courses.flatMap((course) => [...course.keys()].slice(-1))) + 1;
  const numbers = Array.from({ length: end }, (_, n) => n);
  return [numbers.map((n) => n * field_s), ...courses.map((course) => numbers.map((n) => course.get(n) ?? null))];
}

/** Courses side by side, as means over the cycle. @param {Course[]} courses @param {Map<number, number>[]} phases by the field's number */
export function overPhase(courses, phases) {
  return [Array.from({ length: BINS }, (_, i) => (i + 0.5) / BINS), ...courses.map((course, i) => means(course, phases[i]))];
}

/** @param {Course} course @param {Map<number, number>} phase */
function means(course, phase) {
  const sums = Array.from({ length: BINS }, () => ({ sum: 0, count: 0 }));
  for (const [n, value] of course) {
    if (!phase.has(n)) continue;
    const bin = sums[Math.min(BINS - 1, Math.floor(/** @type {number} */ (phase.get(n)) * BINS))];
    bin.sum += value;
    bin.count += 1;
  }
  return sums.map(({ sum, count }) => (count ? sum / count : null));
}

/** From the least to the greatest; null where nothing was seen. @param {Course} course */
export function strokeOf(course) {
  const values = [...course.values()];
  return values.length ? values.reduce((a, b) => Math.max(a, b)) - values.reduce((a, b) => Math.min(a, b)) : null;
}
