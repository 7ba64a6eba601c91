// The range of values that the colours stand for. Nothing here touches the page.

/**
 * @typedef {object} Scale
 * @property {number} low value of the first colour
 * @property {number} high of the last
 * @property {"rising" | "signed"} map
 */

const OUTERMOST = 0.02;
const FEWEST_TICKS = 3;

/**
 * From the least to the greatest value, but for the outermost two in a hundred; a signed one has nought in the
 * middle.
 * @param {ArrayLike<number>} values those that are not finite are passed over
 * @param {boolean} signed
 * @returns {Scale | null} none where there is no value
 */
export function scaleOver(values, signed) {
  const known = Float64Array.from(values).filter(Number.isFinite).sort(); // typed arrays sort by value, plain ones as text
  if (!known.length) return null;
  const low = known[Math.floor(OUTERMOST * (known.length - 1))];
  const high = known[Math.ceil((1 - OUTERMOST) * (known.length - 1))];
  return signed ? about(Math.max(Math.abs(low), Math.abs(high))) : from(low, high);
}

/** One that has both. @param {Scale | null} one @param {Scale | null} other @returns {Scale | null} */
export function together(one, other) {
  if (!one || !other) return one ?? other;
  return { low: Math.min(one.low, other.low), high: Math.max(one.high, other.high), map: one.map };
}

/** Place of a value on a scale, from 0 to 1; −1 without a value. @param {Scale} scale @param {number} value */
export function shareOf(scale, value) {
  if (!Number.isFinite(value)) return -1;
  return Math.min(Math.max((value - scale.low) / (scale.high - scale.low), 0), 1);
}

/**
 * Round numbers from low to high, three to `most` of them, 1, 2 or 5 times a power of ten apart.
 * @param {number} low
 * @param {number} high
 * @returns {number[]}
 */
export function ticks(low, high, most = 6) {
  const step = stepOf(high - low, most);
  const found = multiples(low, high, step);
  return found.length < FEWEST_TICKS ? multiples(low, high, step / 2) : found;
}

/** Digits after the point that tell ticks apart. @param {number[]} marks */
export function digitsOf(marks) {
  const apart = marks.length > 1 ? marks[1] - marks[0] : Math.abs(marks[0]) || 1;
  const digits = Math.max(0, -Math.floor(Math.log10(apart) + 1e-9));
  return Math.abs(apart * 10 ** digits - Math.round(apart * 10 ** digits)) > 1e-6 ? digits + 1 : digits;
}

/** @param {number} low @param {number} high @returns {Scale} */
function from(low, high) {
  return { low, high: Math.max(high, low + 1e-9 + 1e-6 * Math.abs(low)), map: "rising" };
}

/** @param {number} most @returns {Scale} */
function about(most) {
  const end = Math.max(most, 1e-9);
  return { low: -end, high: end, map: "signed" };
}

/** @param {number} span @param {number} most */
function stepOf(span, most) {
  const power = 10 ** Math.floor(Math.log10(span / most));
  return power * ([1, 2, 5, 10].find((each) => each * power >= (span / most) * (1 - 1e-9)) ?? 10);
}

/** @param {number} low @param {number} high @param {number} step */
function multiples(low, high, step) {
  const first = Math.ceil(low / step - 1e-9);
  const count = Math.floor(high / step + 1e-9) - first + 1;
  return Array.from({ length: Math.max(count, 0) }, (_, i) => (first + i) * step + 0);
}
