// The state of the page: one value, changed in one place, read by subscribers.

/** @import { Device, Session, State } from "types/documents" */

/**
 * @typedef {object} Known
 * @property {Session | null} session of the user; null before signing in
 * @property {State | null} state of the daemon
 * @property {{online: boolean, since: number}} connection since: by Date.now()
 * @property {string | null} device the chosen device's name
 * @property {number} clockOffset_ms the daemon's time minus this tablet's
 */

/** @typedef {ReturnType<typeof createStore>} Store */

/** @param {Known} first */
export function createStore(first) {
  let known = first;
  /** @type {Set<() => void>} */
  const watchers = new Set();

  /** Changes what is given, and tells who subscribed. @param {Partial<Known>} change */
  function set(change) {
    known = { ...known, ...change };
    for (const watcher of [...watchers]) watcher();
  }

  /**
   * Calls the listener with what the selector picks: at once, and whenever that is another value (===).
   * @template T
   * @param {(known: Known) => T} selector
   * @param {(value: T, known: Known) => void} listener
   * @returns {() => void} ends it
   */
  function subscribe(selector, listener) {
    let last = selector(known);
    const watcher = () => {
      const value = selector(known);
      if (value === last) return;
      last = value;
      listener(value, known);
    };
    watchers.add(watcher);
    listener(last, known);
    return () => watchers.delete(watcher);
  }

  return { get: () => known, set, subscribe };
}

/** The chosen device, or the only one, or null. @param {Known} known @returns {Device | null} */
export function deviceOf(known) {
  const devices = known.state?.devices ?? {};
  return devices[known.device ?? ""] ?? Object.values(devices)[0] ?? null;
}

/** True if there is more than one grabber. @param {Known} known */
export function isSeveral(known) {
  return Object.keys(known.state?.devices ?? {}).length > 1;
}

const NOMINAL_HZ = 50;

/** Fields a second of a device's stream; PAL's as long as there is none. @param {Device | null} device */
export function rateOf(device) {
  const rate_hz = device?.stream?.rate_hz;
  return typeof rate_hz === "number" ? rate_hz : NOMINAL_HZ;
}

const STREAMING = new Set(["ready", "no_signal", "capturing"]);

/** True if a device is known to be open and at work. @param {Device | null} device @returns {device is Device} */
export function streams(device) {
  return device !== null && STREAMING.has(device.state);
}

/** True if fields come from a device: before that there is nothing to ask about them. @param {Device | null} device @returns {device is Device} */
export function delivers(device) {
  return streams(device) && device.rate_hz !== null;
}

/**
 * A document with a change (RFC 7396, but null stays null, because in the state it has a meaning). Parts that did not
 * change remain the same objects: subscribers compare by identity.
 * @param {unknown} document
 * @param {unknown} change
 * @returns {unknown}
 */
export function merged(document, change) {
  if (!isObject(change)) return change;
  const result = isObject(document) ? { ...document } : {};
  for (const [key, value] of Object.entries(change)) result[key] = merged(result[key], value);
  return result;
}

/** @param {unknown} value @returns {value is Record<string, unknown>} */
const isObject = (value) => value !== null && typeof value === "object" && !Array.isArray(value);
