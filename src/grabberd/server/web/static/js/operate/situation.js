// The situation in front of the instrument: its state in a word, and why Start is not offered.
import { deviceOf } from "../core/store.js";
import { worstOf } from "../lights/judge.js";

/** @import { Known } from "../core/store.js" */
/** @import { Light } from "../lights/judge.js" */
/** @import { Device } from "types/documents" */

/** @type {Record<Device["state"] | "armed" | "troubled" | "away" | "none", string>} */
const LEVELS = {
  ready: "good", troubled: "bad", capturing: "busy", armed: "busy", no_signal: "warn", opening: "idle", recovering: "warn",
  absent: "bad", failed: "bad", ended: "idle", away: "bad", none: "bad",
};
/** @type {typeof LEVELS} */
const SYMBOLS = {
  ready: "ready", troubled: "bad", capturing: "capturing", armed: "armed", no_signal: "warn", opening: "wait", recovering: "wait",
  absent: "bad", failed: "bad", ended: "stop", away: "away", none: "bad",
};
const REFUSING = new Set(["absent", "opening", "recovering", "failed", "ended"]);

/**
 * @typedef {object} Situation
 * @property {string} word key of operate.state
 * @property {string} level of that word, or of the instrument's health if that is worse
 * @property {string} symbol
 * @property {string | number | null} since
 * @property {string | null} running id of the capture that is being recorded
 * @property {string | null} armed id of the one that waits
 * @property {string | null} group id of the group that either of them belongs to
 * @property {string | null} why key of operate.why: what keeps Start from being offered
 * @property {Light | null} worst what is wrong with the instrument
 * @property {boolean} doubtful a capture may be started, but would be of little use
 */

/** @param {Known} known what the store holds @param {boolean} mayOperate @returns {Situation} */
export function situationOf(known, mayOperate) {
  const device = deviceOf(known);
  const worst = known.connection.online && known.state && device ? worstOf(device, known.state) : null;
  const word = wordOf(known, device, worst);
  return {
    word,
    level: worse(LEVELS[word], worst),
    symbol: SYMBOLS[word],
    since: word === "away" ? known.connection.since + known.clockOffset_ms : device?.since_utc ?? null,
    running: device?.capture_id ?? null,
    armed: device?.armed_capture_id ?? null,
    group: device?.group_id ?? null,
    why: whyNot(known, device, mayOperate),
    worst,
    doubtful: device?.health.start === "doubtful",
  };
}

/** @param {string} level @param {Light | null} worst */
function worse(level, worst) {
  if (!worst || level === "bad") return level;
  return worst.level === "bad" || level !== "busy" ? worst.level : level;
}

/** @param {Known} known @param {Device | null} device @param {Light | null} worst @returns {keyof typeof LEVELS} */
function wordOf(known, device, worst) {
  if (!known.connection.online) return "away";
  if (!device) return "none";
  if (device.armed_capture_id && device.state === "ready") return "armed";
  return device.state === "ready" && worst?.level === "bad" ? "troubled" : device.state;
}

/** @param {Known} known @param {Device | null} device @param {boolean} mayOperate */
function whyNot(known, device, mayOperate) {
  if (!mayOperate) return "viewer";
  if (!known.connection.online) return "away";
  if (!device) return "none";
  if (REFUSING.has(device.state)) return device.state;
  if (device.health.start !== "refused") return device.sealing_capture_id ? "sealing" : null;
  return known.state?.storage.minutes_left === 0 ? "full" : "broken";
}
