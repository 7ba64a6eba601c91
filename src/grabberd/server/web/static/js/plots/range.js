// A part of a chart's x: zoomed, moved, and kept inside what there is. Nothing here touches the page.

/** @typedef {[number, number]} Range */

/**
 * The part that comes nearest to the wanted one; null where that is all there is.
 * @param {Range} whole
 * @param {Range} wanted
 * @param {number} least length of a part
 * @returns {Range | null}
 */
export function partOf([low, high], wanted, least) {
  const long = Math.max(wanted[1] - wanted[0], least);
  if (!(long < high - low)) return null;
  const from = Math.min(Math.max(wanted[0], low), high - long);
  return [from, from + long];
}

/** Zoomed about a share of it. @param {Range} range @param {number} share @param {number} factor @returns {Range} */
export function zoomedAbout([low, high], share, factor) {
  const [long, still] = [(high - low) / factor, low + share * (high - low)];
  return [still - share * long, still + (1 - share) * long];
}

/** Between two shares of it. @param {Range} range @param {number} from @param {number} to @returns {Range} */
export function between([low, high], from, to) {
  return [low + Math.min(from, to) * (high - low), low + Math.max(from, to) * (high - low)];
}

/** Share of a range at which a place lies; the middle where it lies outside, or nowhere. @param {Range} range @param {number | null} place */
export function shareIn([low, high], place) {
  return place !== null && place >= low && place <= high && high > low ? (place - low) / (high - low) : 0.5;
}

/** A range that goes along with a place that leaves it. @param {Range | null} range @param {number} place @param {Range} whole */
export function movedTo(range, place, whole) {
  if (!range || (place >= range[0] && place <= range[1])) return range;
  return partOf(whole, [place, place + range[1] - range[0]], 0);
}
