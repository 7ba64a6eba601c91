// What the page knows: one value, changed in one place, read by whoever subscribes.

/**
 * @typedef {object} Known
 * @property {{role: string, by: string, token: string | null} | null} session who uses the page; null: nobody yet
 * @property {any} state the daemon's state document (GET /api/v1/state), or null
 * @property {{online: boolean, since: number}} connection since: by Date.now()
 * @property {string | null} device the chosen device's name
 * @property {number} clockOffset_ms what has to be added to this tablet's clock for the daemon's time
 */

/**
 * @param {Known} first
 */
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

/** The chosen device's document, or that of the only one, or null. @param {Known} known */
export function deviceOf(known) {
  const devices = known.state?.devices ?? {};
  return devices[known.device ?? ""] ?? Object.values(devices)[0] ?? null;
}

const STREAMING = new Set(["ready", "no_signal", "capturing"]);

/** Whether a device is open and at work, so far as is known. @param {any} device its document, or null */
export function streams(device) {
  return STREAMING.has(device?.state);
}

/** Whether fields come from it: before that there is nothing to be asked of them. @param {any} device its document, or null */
export function delivers(device) {
  return streams(device) && device.rate_hz !== null;
}

/**
 * A document with a change (RFC 7396, but null stays null); parts that did not change are the same objects.
 * @param {any} document
 * @param {any} change
 */
export function merged(document, change) {
  if (change === null || typeof change !== "object" || Array.isArray(change)) return change;
  const result = document !== null && typeof document === "object" && !Array.isArray(document) ? { ...document } : {};
  for (const [key, value] of Object.entries(change)) result[key] = merged(result[key], value);
  return result;
}
