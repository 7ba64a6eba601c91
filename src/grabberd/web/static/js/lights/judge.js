// The state of each light: a level, a word, and possible causes. Nothing here touches the page.
import { deviceOf, rateOf, streams as isStreaming } from "../core/store.js";

/** @import { Known } from "../core/store.js" */
/** @import { LossHistory } from "./history.js" */
/** @import { Device, State, Storage } from "types/documents" */

/** @typedef {{hz?: number, wanted?: number, n?: number, waiting?: number, slots?: number, id?: string, days?: number, minutes?: number, seconds?: number}} LightValues */

/**
 * @typedef {object} Light
 * @property {string} id
 * @property {"good" | "warn" | "bad" | "idle"} level
 * @property {string} word key of lights.ID.words
 * @property {LightValues} [values] of that word
 * @property {string} [cause] key of lights.ID.causes: what the page itself finds wrong
 * @property {string | null} [code] key of causes: what the daemon says is wrong
 * @property {string[]} [said] the same in its own words; without a cause and without these nothing is wrong
 * @property {string | null} [since] where the daemon knows it
 */

const CLOCK_MS = 5000;
const MANY_LOST = 0.01;

/**
 * @param {Known} known what the store holds
 * @param {LossHistory} history
 * @returns {Light[]}
 */
export function judge(known, history) {
  const device = deviceOf(known);
  if (!known.connection.online || !known.state || !device) return IDS.map((id) => idle(id));
  const streams = isStreaming(device);
  return [
    grabber(device, streams),
    signal(device, streams),
    streams ? rate(device) : idle("rate"),
    streams ? lost(history) : idle("lost"),
    ring(device),
    computer(device),
    calibration(device),
    rig(device),
    order(device),
    disk(known.state.storage),
    records(known.state),
    clock(known),
  ];
}

const IDS = ["grabber", "signal", "rate", "lost", "ring", "computer", "calibration", "rig", "order", "disk", "records", "clock"];

/** The daemon's own words about a problem, as far as it has any. @param {(string | null)[]} said */
const knownOf = (said) => said.flatMap((one) => (one ? [one] : []));

/** @param {string} id @returns {Light} */
function idle(id) {
  return { id, level: "idle", word: "unknown" };
}

/** @param {Device} device @param {boolean} streams @returns {Light} */
function grabber(device, streams) {
  if (streams) return { id: "grabber", level: "good", word: "good" };
  const about = { id: "grabber", since: device.since_utc, code: device.cause_code, said: knownOf([device.cause, device.hint]) };
  if (device.state === "ended") return { ...about, level: "idle", word: "ended" };
  if (device.state === "opening" || device.cause_code === "not_opened") return { ...about, level: "idle", word: "opening" };
  return { ...about, level: device.state === "recovering" ? "warn" : "bad", word: device.state };
}

/** @param {Device} device @param {boolean} streams @returns {Light} */
function signal(device, streams) {
  if (!streams) return idle("signal");
  const isAway = device.state === "no_signal" || device.signal === "absent";
  if (!isAway) return { id: "signal", level: "good", word: "good" };
  const code = device.cause_code ?? "no_signal";
  return { id: "signal", level: "bad", word: "absent", code, since: device.since_utc, said: knownOf([device.cause]) };
}

/** @param {Device} device @returns {Light} */
function rate(device) {
  const now = device.rate_hz;
  if (now === null) return { id: "rate", level: "idle", word: "counting" };
  const wanted = rateOf(device);
  const values = { hz: now, wanted };
  if (Math.abs(now - wanted) <= 0.04 * wanted) return { id: "rate", level: "good", word: "good", values };
  const level = now < 0.8 * wanted ? "bad" : "warn";
  return { id: "rate", level, word: "off", values, cause: "off" };
}

/** @param {LossHistory} history @returns {Light} */
function lost(history) {
  const { lost: count, all } = history.losses();
  if (count === 0) return { id: "lost", level: "good", word: "none" };
  const level = count > MANY_LOST * all ? "bad" : "warn";
  return { id: "lost", level, word: "some", values: { n: count }, cause: "some" };
}

/** @param {Device} device @returns {Light} */
function ring(device) {
  const share = device.ring.waiting / device.ring.slots;
  const values = { waiting: device.ring.waiting, slots: device.ring.slots };
  if (share < 0.6) return { id: "ring", level: "good", word: "good", values };
  return { id: "ring", level: share < 0.95 ? "warn" : "bad", word: "full", values, cause: "full" };
}

/** @param {Device} device @returns {Light} */
function computer(device) {
  const { cause, hint, cause_code: code, since_utc: since } = device.computer;
  if (!cause) return { id: "computer", level: "good", word: "good" };
  const word = code === "program_stopped" ? "stopped" : code === "driver_hung" ? "hung" : "busy";
  return { id: "computer", level: "warn", word, code, since, said: knownOf([cause, hint]) };
}

/** @param {Device} device @returns {Light} */
function calibration(device) {
  const lack = device.lacks.find((one) => one.lacks === "calibration");
  const said = lack ? [lack.message, lack.hint] : [];
  const wrong = { code: lack?.cause_code, said };
  if (!device.calibration) return { id: "calibration", level: "bad", word: "none", ...wrong };
  const values = { id: device.calibration.id, days: device.calibration.age_days };
  if (lack) return { id: "calibration", level: "bad", word: lack.cause_code === "no_object" ? "noObject" : "misfit", values, ...wrong };
  return { id: "calibration", level: "good", word: "good", values };
}

/** @param {Device} device @returns {Light} */
function rig(device) {
  const verdict = device.rig?.verdict ?? "unknown";
  if (verdict === "fits") return { id: "rig", level: "good", word: "fits" };
  if (verdict === "unknown") return { id: "rig", level: "idle", word: "unknown" };
  const level = verdict === "doubtful" ? "warn" : "bad";
  return { id: "rig", level, word: verdict, cause: verdict };
}

/** What an object at rest cannot tell is not known yet. @param {Device} device @returns {Light} */
function order(device) {
  const found = device.field_order?.order ?? "unknown";
  if (found === "right") return { id: "order", level: "good", word: found };
  if (found === "reversed" || found === "same_instant") return { id: "order", level: "bad", word: found, cause: found };
  return { id: "order", level: "idle", word: found };
}

/** @param {Storage} storage @returns {Light} */
function disk(storage) {
  const minutes = storage.minutes_left;
  if (minutes === null) return { id: "disk", level: "bad", word: "broken", code: storage.cause_code, said: knownOf([storage.problem]) };
  const values = { minutes };
  if (minutes >= 60) return { id: "disk", level: "good", word: "good", values };
  return { id: "disk", level: minutes < 10 ? "bad" : "warn", word: minutes > 0 ? "short" : "full", values, cause: "full" };
}

/** What is wrong with the daemon itself; what the disk's light tells is left to it. @param {State} state @returns {Light} */
function records({ faults, storage }) {
  const worst = faults.find((one) => one.cause_code !== storage.cause_code);
  if (!worst) return { id: "records", level: "good", word: "good" };
  const level = worst.level === "fault" ? "bad" : "warn";
  return { id: "records", level, word: worst.level, code: worst.cause_code, since: worst.since_utc, said: [worst.message, worst.hint] };
}

/** @param {Known} known @returns {Light} */
function clock(known) {
  const off_ms = known.clockOffset_ms;
  if (Math.abs(off_ms) <= CLOCK_MS) return { id: "clock", level: "good", word: "good" };
  return { id: "clock", level: "warn", word: off_ms > 0 ? "ahead" : "behind", values: { seconds: Math.abs(off_ms) / 1000 }, cause: "off" };
}
