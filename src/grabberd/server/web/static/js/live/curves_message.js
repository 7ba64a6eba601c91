// The messages of the wall's movement and the vacuum, joined into the last seconds. Nothing here touches the page.

/** @import { CurvesMessage, State } from "types/documents" */

/** @typedef {CurvesMessage} CurvesMessage */

const WELL = new Set(["ready", "opening"]);

/**
 * @typedef {object} Sample a field that was measured
 * @property {number} time_s
 * @property {number | null} left targets in the left view
 * @property {number | null} right
 * @property {number} points
 * @property {number | null} residual_px
 * @property {number | null} latency_ms
 * @property {{width_mm: number | null, sigma_mm: number | null}[]} widths
 *
 * @typedef {{time_s: number, kpa: Record<string, number | null>}} Reading
 *
 * @typedef {object} Curves
 * @property {number} now_s by the daemon's monotonic clock, as all times
 * @property {number} epoch_s what makes a time of it one since 1970
 * @property {Sample[]} fields
 * @property {Reading[]} readings
 */

/**
 * @typedef {object} LoggerHere
 * @property {string} name
 * @property {string[]} channels
 * @property {string | null} cause why it gives nothing
 */

/**
 * The loggers that measure a vacuum for a device.
 * @param {State | null} state
 * @param {string | undefined} device
 * @returns {LoggerHere[]}
 */
export function loggersOf(state, device) {
  return Object.values(state?.loggers ?? {}).flatMap(({ name, state: now, cause, channels }) => {
    const own = Object.entries(channels).filter(([, { devices, quantity }]) => quantity !== "light" && (!devices.length || devices.includes(device ?? "")));
    return own.length ? [{ name, channels: own.map(([channel]) => channel), cause: WELL.has(now) ? null : cause ?? now }] : [];
  });
}

/**
 * What a message adds; it takes the place of what was known of the same time, since steps are told before they are over.
 * A clock that went back is that of a daemon that was started anew on another computer's start.
 * @param {Curves | null} before
 * @param {CurvesMessage} message
 * @param {number} span_s what is older is forgotten
 * @returns {Curves}
 */
export function readCurves(before, message, span_s) {
  const known = before && before.now_s <= message.now_s ? before : null;
  const oldest_s = message.now_s - span_s;
  return {
    now_s: message.now_s,
    epoch_s: message.now_utc_s - message.now_s,
    fields: joined(known?.fields ?? [], message.time_s.map((time_s, i) => sampleOf(message, time_s, i)), oldest_s),
    readings: joined(known?.readings ?? [], readingsOf(message), oldest_s),
  };
}

/** @param {CurvesMessage} message @param {number} time_s @param {number} i @returns {Sample} */
function sampleOf({ targets, points, residual_px, latency_ms, widths }, time_s, i) {
  return {
    time_s,
    left: targets.left?.[i] ?? null,
    right: targets.right?.[i] ?? null,
    points: points[i],
    residual_px: residual_px[i],
    latency_ms: latency_ms[i],
    widths: widths.map((one) => ({ width_mm: one.width_mm[i], sigma_mm: one.sigma_mm[i] })),
  };
}

/** The channels' steps by their times. @param {CurvesMessage} message @returns {Reading[]} */
function readingsOf({ channels }) {
  /** @type {Map<number, Record<string, number | null>>} */
  const steps = new Map();
  for (const { name, time_s, kpa } of channels) {
    time_s.forEach((time, i) => steps.set(time, Object.assign(steps.get(time) ?? {}, { [name]: kpa[i] })));
  }
  return [...steps].sort(([a], [b]) => a - b).map(([time_s, values]) => ({ time_s, kpa: values }));
}

/**
 * @template {{time_s: number}} Sample
 * @param {Sample[]} before
 * @param {Sample[]} fresh
 * @param {number} oldest_s
 */
function joined(before, fresh, oldest_s) {
  const begin_s = fresh[0]?.time_s ?? Infinity;
  return [...before.filter((one) => one.time_s < begin_s && one.time_s >= oldest_s), ...fresh];
}
