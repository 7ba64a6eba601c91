// Playback: the moment that is shown, and the next one. Nothing here touches the page.

/**
 * @typedef {object} Playback
 * @property {number} at where it stands, in seconds of the capture
 * @property {boolean} playing
 * @property {number} speed 1: as fast as it was
 */

export const SPEEDS = [0.1, 0.25, 0.5, 1, 2];

/** @returns {Playback} */
export const atTheBeginning = () => ({ at: 0, playing: false, speed: 1 });

/**
 * So much later; at the end it begins again.
 * @param {Playback} playback
 * @param {number} passed_s
 * @param {number} length_s
 * @returns {Playback}
 */
export function advanced(playback, passed_s, length_s) {
  if (!playback.playing || length_s <= 0) return playback;
  return { ...playback, at: (playback.at + passed_s * playback.speed) % length_s };
}

/** The moment that is shown at a time: the last one not after it. @param {number[]} times_s ascending @param {number} at */
export function indexAt(times_s, at) {
  let [low, high] = [0, times_s.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times_s[middle] <= at + 1e-9) low = middle + 1;
    else high = middle;
  }
  return Math.max(0, low - 1);
}

/** Duration, up to the end of the last moment. @param {number[]} times_s */
export function lengthOf(times_s) {
  if (times_s.length < 2) return 0;
  const [first, last] = [times_s[0], times_s[times_s.length - 1]];
  return last - first + (last - first) / (times_s.length - 1);
}
