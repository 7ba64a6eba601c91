// The state of each light: a level, a word, and possible causes, as the daemon judges them. Nothing here touches the page.
import { deviceOf, rateOf } from "../core/store.js";

/** @import { Known } from "../core/store.js" */
/** @import { Device, HealthPart, State } from "types/documents" */

/** @typedef {{hz?: number, wanted?: number, n?: number, waiting?: number, slots?: number, id?: string, days?: number, minutes?: number, seconds?: number, points?: number}} LightValues */

/**
 * @typedef {object} Light
 * @property {string} id
 * @property {"good" | "warn" | "bad" | "idle"} level
 * @property {string} word key of lights.ID.words
 * @property {LightValues} [values] of that word
 * @property {string | null} [code] key of causes: what the daemon says is wrong
 * @property {string[]} [said] the same in its own words; without these nothing is wrong
 * @property {string | null} [since] where the daemon knows it
 */

const CLOCK_MS = 5000;

/** The daemon's levels as the page draws them. @type {Record<string, Light["level"]>} */
export const LEVELS = { good: "good", warning: "warn", bad: "bad", unknown: "idle" };

export const IDS = ["device", "signal", "rate", "lost", "ring", "computer", "calibration", "measurement", "rig", "order", "disk", "records", "clock"];

/** @param {Known} known what the store holds @returns {Light[]} */
export function judge(known) {
  const { state } = known;
  const device = deviceOf(known);
  if (!known.connection.online || !state || !device) return IDS.map((id) => ({ id, level: "idle", word: "unknown" }));
  /** @type {Record<string, HealthPart>} */
  const parts = device.health.parts;
  // What does not apply to a device, such as the order of fields where pictures are progressive, has no light.
  return IDS.filter((id) => parts[id]).map((id) => (id === "clock" && parts[id].level === "good" ? clock(known) : light(id, parts[id], valuesOf(id, device, state))));
}

/** The worst part of a device as a light; null if nothing is wrong. @param {Device} device @param {State} state @returns {Light | null} */
export function worstOf(device, state) {
  const { part, parts } = device.health;
  return part ? light(part, parts[part], valuesOf(part, device, state)) : null;
}

/** @param {string} id @param {HealthPart} part @param {LightValues} values @returns {Light} */
function light(id, part, values) {
  const said = [part.message ?? "", part.hint ?? ""].filter((one) => one !== "");
  return { id, level: LEVELS[part.level], word: part.word, values, code: part.cause_code, said, since: part.since_utc };
}

/** The numbers in a light's word, from where the state has them. @param {string} id @param {Device} device @param {State} state @returns {LightValues} */
function valuesOf(id, device, state) {
  if (id === "rate") return { hz: device.rate_hz ?? undefined, wanted: rateOf(device) };
  if (id === "lost") return device.last_minute.lost ? { n: device.last_minute.lost } : {};
  if (id === "ring") return { waiting: device.ring.waiting, slots: device.ring.slots };
  if (id === "calibration" && device.calibration) return { id: device.calibration.id, days: device.calibration.age_days };
  if (id === "measurement") return { points: device.live?.points };
  if (id === "disk") return { minutes: state.storage.minutes_left ?? undefined };
  return {};
}

/** The instrument's time of day beside this tablet's. @param {Known} known @returns {Light} */
function clock(known) {
  const off_ms = known.clockOffset_ms;
  if (Math.abs(off_ms) <= CLOCK_MS) return { id: "clock", level: "good", word: "good" };
  return { id: "clock", level: "warn", word: off_ms > 0 ? "ahead" : "behind", values: { seconds: Math.abs(off_ms) / 1000 } };
}
