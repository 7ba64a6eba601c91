// What the daemon's events say over time, kept from when the page was opened, whichever panel is shown.
import { createRing } from "./ring.js";

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
 * @property {{targets: number[], width_mm: number | null, sigma_mm: number | null}[]} widths
 */

/**
 * @param {any} store
 * @param {() => number} now_ms the daemon's time
 */
export function createHistory(store, now_ms) {
  /** @type {Map<string, ReturnType<typeof createRing>>} */
  const rings = new Map();
  /** @type {Map<string, any>} */
  const seen = new Map();
  /** @type {Set<() => void>} */
  const watchers = new Set();

  store.subscribe((/** @type {any} */ known) => known.state, (/** @type {any} */ state) => {
    const devices = Object.entries(state?.devices ?? {});
    const fresh = devices.filter(([name, device]) => device.live && seen.get(name) !== device.live);
    for (const [name, device] of fresh) enter(name, device.live);
    if (fresh.length) for (const watcher of [...watchers]) watcher();
  });

  /** @param {string} name @param {any} live */
  function enter(name, live) {
    seen.set(name, live);
    if (!rings.has(name)) rings.set(name, createRing(SPAN_S));
    rings.get(name)?.push(sampleOf(live, now_ms() / 1000));
  }

  return {
    /** @param {string} device @param {number} last_s @returns {Sample[]} */
    samples: (device, last_s) => /** @type {any} */ (rings.get(device)?.all(last_s) ?? []),
    /** Calls when there are more. @param {() => void} listener @returns {() => void} ends it */
    watch(listener) {
      watchers.add(listener);
      return () => watchers.delete(listener);
    },
  };
}

/** @param {any} live of the device's document @param {number} time_s @returns {Sample} */
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
