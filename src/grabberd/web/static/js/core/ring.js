// Samples of the last minutes.

/**
 * @template {{time_s: number}} Sample
 * @typedef {{push: (sample: Sample) => void, all: (last_s?: number) => Sample[]}} Ring
 */

/**
 * @template {{time_s: number}} Sample
 * @param {number} span_s older ones are forgotten
 * @returns {Ring<Sample>}
 */
export function createRing(span_s) {
  /** @type {Sample[]} */
  let samples = [];
  let first = 0;

  /** Time goes forward: a sample that is not later than the last is passed over. @param {Sample} sample */
  function push(sample) {
    const last = samples[samples.length - 1];
    if (last && sample.time_s <= last.time_s) return;
    samples.push(sample);
    while (samples[first].time_s < sample.time_s - span_s) first += 1;
    if (first > samples.length / 2) {
      samples = samples.slice(first);
      first = 0;
    }
  }

  /** Those of the last seconds, the oldest first. @param {number} [last_s] @returns {Sample[]} */
  function all(last_s = span_s) {
    const newest = samples[samples.length - 1];
    return newest ? samples.slice(first).filter((sample) => sample.time_s >= newest.time_s - last_s) : [];
  }
  return { push, all };
}
