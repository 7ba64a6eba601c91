// Where pulsations begin: by an analysis, or by the curve itself. Nothing here touches the page.

/** Share of the movement that a curve has to go beyond its middle: noise there is no pulsation. */
const HYSTERESIS = 0.2;
const LEAST_MM = 0.3;
const SHORTEST_S = 0.2;

/** The fields in which a cycle begins, where the phase starts anew. @param {Map<number, number>} phases by field, in order @returns {number[]} */
export function startsByPhase(phases) {
  let before = 0;
  return [...phases].flatMap(([n, phase]) => {
    const begins = before - phase > 0.5;
    before = phase;
    return begins ? [n] : [];
  });
}

/** The fields in which a curve rises through its middle. @param {[number, number][]} curve fields and values, in order @returns {number[]} */
export function startsByCurve(curve) {
  const values = curve.map(([, value]) => value);
  const [low, high] = [Math.min(...values), Math.max(...values)];
  if (!(high - low > LEAST_MM)) return [];
  const [middle, apart] = [(low + high) / 2, HYSTERESIS * (high - low)];
  let below = false;
  return curve.flatMap(([n, value]) => {
    const rises = below && value > middle + apart;
    if (value < middle - apart) below = true;
    if (rises) below = false;
    return rises ? [n] : [];
  });
}

/**
 * The cycle that a field is in, or the nearest whole one; null where there is none.
 * @param {number[]} starts in order
 * @param {number} n
 * @param {number} field_s from field to field
 * @returns {[number, number] | null} its first field, and the one after its last
 */
export function cycleAt(starts, n, field_s) {
  const cycles = starts.slice(1).map((end, i) => /** @type {[number, number]} */ ([starts[i], end])).filter(([first, end]) => (end - first) * field_s >= SHORTEST_S);
  const apart = (/** @type {[number, number]} */ [first, end]) => Math.max(first - n, n - (end - 1), 0);
  return cycles.reduce((/** @type {[number, number] | null} */ best, one) => (best && apart(best) <= apart(one) ? best : one), null);
}
