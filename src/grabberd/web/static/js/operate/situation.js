// The situation in front of the instrument: its state in a word, and why Start is not offered.
import { deviceOf } from "../core/store.js";

/** @import { Known } from "../core/store.js" */
/** @import { Device } from "types/documents" */

/** @type {Record<Device["state"] | "armed" | "away" | "none", string>} */
const LEVELS = {
  ready: "good", capturing: "busy", armed: "busy", no_signal: "warn", opening: "idle", recovering: "warn",
  absent: "bad", failed: "bad", ended: "idle", away: "bad", none: "bad",
};
/** @type {typeof LEVELS} */
const SYMBOLS = {
  ready: "ready", capturing: "capturing", armed: "armed", no_signal: "warn", opening: "wait", recovering: "wait",
  absent: "bad", failed: "bad", ended: "stop", away: "away", none: "bad",
};
const REFUSING = new Set(["absent", "opening", "recovering", "failed", "ended"]);

/**
 * @typedef {object} Situation
 * @property {string} word key of operate.state
 * @property {string} level
 * @property {string} symbol
 * @property {string | number | null} since
 * @property {string | null} running id of the capture that is being recorded
 * @property {string | null} armed id of the one that waits
 * @property {string | null} group id of the group that either of them belongs to
 * @property {string | null} why key of operate.why: what keeps Start from being offered
 */

/** @param {Known} known what the store holds @param {boolean} mayOperate @returns {Situation} */
export function situationOf(known, mayOperate) {
  const device = deviceOf(known);
  const word = wordOf(known, device);
  return {
    word,
    level: LEVELS[word],
    symbol: SYMBOLS[word],
    since: word === "away" ? known.connection.since + known.clockOffset_ms : device?.since_utc ?? null,
    running: device?.capture_id ?? null,
    armed: device?.armed_capture_id ?? null,
    group: device?.group_id ?? null,
    why: whyNot(known, device, mayOperate),
  };
}

/** @param {Known} known @param {Device | null} device @returns {keyof typeof LEVELS} */
function wordOf(known, device) {
  if (!known.connection.online) return "away";
  if (!device) return "none";
  if (device.armed_capture_id && device.state === "ready") return "armed";
  return device.state;
}

/** @param {Known} known @param {Device | null} device @param {boolean} mayOperate */
function whyNot(known, device, mayOperate) {
  if (!mayOperate) return "viewer";
  if (!known.connection.online) return "away";
  if (!device) return "none";
  if (REFUSING.has(device.state)) return device.state;
  return known.state?.storage.minutes_left === 0 ? "full" : null;
}
