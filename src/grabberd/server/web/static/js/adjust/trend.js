// Sharpness of both views over the last minutes. Nothing here touches the page.

/** @typedef {{time_s: number, left: number | null, right: number | null}} Sample */

/** @param {number} span_s older ones are forgotten */
export function createTrend(span_s) {
  /** @type {Sample[]} */
  let samples = [];
  return {
    /** @param {Sample} sample */
    add(sample) {
      samples = [...samples.filter((one) => one.time_s >= sample.time_s - span_s), sample];
    },
    clear() {
      samples = [];
    },
    samples: () => samples,
  };
}

/** The best value of a view and when it was; null where there is none. @param {Sample[]} samples @param {"left" | "right"} name */
export function bestOf(samples, name) {
  /** @type {{value: number, time_s: number} | null} */
  let best = null;
  for (const { time_s, [name]: value } of samples) if (value !== null && value > (best?.value ?? -Infinity)) best = { value, time_s };
  return best;
}
