// History of the daemon's events since the page was opened, whichever panel is shown.
import { createRing } from "./ring.js";

/** @import { Ring } from "./ring.js" */
/** @import { Store } from "./store.js" */
/** @import { Live } from "types/documents" */

export const SPAN_S = 600;
/** Nothing for so long is a gap: events come five times a second. */
export const GAP_S = 2;

/**
 * @typedef {object} Sample
 * @property {number} time_s since 1970
 * @property {number | null} left targets in the left view
 * @property {number | null} right
 * @property {number | null} points
 * @property {number | null} residual_px
 * @property {number | null} p50_ms latency
 * @property {number | null} p99_ms
 * @property {Live["widths"]} widths
 */

/** @typedef {ReturnType<typeof createHistory>} History */

/**
 * @param {Store} store
 * @param {() => number} now_ms the daemon's time
 */
export function createHistory(store, now_ms) {
  /** @type {Map<string, Ring<Sample>>} */
  const rings = new Map();
  /** @type {Map<string, Live>} */
  const seen = new Map();
  /** @type {Set<() => void>} */
  const watchers = new Set();

  store.subscribe((known) => known.state, (state) => {
    const devices = Object.entries(state?.devices ?? {});
    const fresh = devices.filter(([name, { live }]) => live && enter(name, live));
    if (fresh.length) for (const watcher of [...watchers]) watcher();
  });

  /** Tells whether it was new: a part of the state that did not change is the same object. @param {string} name @param {Live} live */
  function enter(name, live) {
    if (seen.get(name) === live) return false;
    seen.set(name, live);
    const ring = rings.get(name) ?? createRing(SPAN_S);
    rings.set(name, ring);
    ring.push(sampleOf(live, now_ms() / 1000));
    return true;
  }

  return {
    /** @param {string} device @param {number} last_s @returns {Sample[]} */
    samples: (device, last_s) => rings.get(device)?.all(last_s) ?? [],
    /** Calls when there are more. @param {() => void} listener @returns {() => void} ends it */
    watch(listener) {
      watchers.add(listener);
      return () => watchers.delete(listener);
    },
  };
}

/** @param {Live} live @param {number} time_s @returns {Sample} */
export function sampleOf(live, time_s) {
  return {
    time_s,
    left: live.views?.left ?? null,
    right: live.views?.right ?? null,
    points: live.points,
    residual_px: live.residual_px,
    p50_ms: live.latency_ms?.p50 ?? null,
    p99_ms: live.latency_ms?.p99 ?? null,
    widths: live.widths ?? [],
  };
}
