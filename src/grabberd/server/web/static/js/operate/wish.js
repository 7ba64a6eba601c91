// The capture that an operator wishes for, and the request that it makes. Nothing here touches the page.

/** @import { Limits } from "../core/number.js" */

/**
 * @typedef {object} Wish
 * @property {"stop" | "seconds" | "cycles" | "fields"} kind of the length
 * @property {number} seconds
 * @property {number} cycles
 * @property {number} fields
 * @property {number} perMinute pulsations a minute
 * @property {number | null} ownPerMinute the same as entered on this tablet; null: as measured last
 * @property {number} before fields before the start that belong to it
 * @property {boolean} wait arm first
 * @property {boolean} all of all grabbers together
 * @property {Record<string, string>} labels
 * @property {string} note
 * @property {string} of id of the capture that labels and note belong to; empty: the next one
 */

/**
 * Changes one entry of the wish.
 * @typedef {<Name extends keyof Wish>(name: Name, value: Wish[Name]) => void} Change
 */

/** @type {Wish["kind"][]} */
export const KINDS = ["stop", "seconds", "cycles", "fields"];

/** @type {Wish} */
export const USUAL = {
  kind: "seconds", seconds: 10, cycles: 10, fields: 500, perMinute: 60, ownPerMinute: null, before: 0, wait: false, all: false, labels: {}, note: "", of: "",
};

/** An earlier wish as it was kept; entries of the wrong type, which an older edition of the page may have kept, are left out. @param {unknown} kept @returns {Partial<Wish>} */
export function wishFrom(kept) {
  const entries = Object.entries(typeof kept === "object" && kept !== null ? kept : {});
  return Object.fromEntries(entries.filter(([name, value]) => isUsual(name, value)));
}

/** @param {string} name @param {unknown} value */
function isUsual(name, value) {
  if (name === "kind") return KINDS.some((kind) => kind === value);
  if (name === "ownPerMinute") return value === null || typeof value === "number";
  const usual = Object.entries(USUAL).find(([one]) => one === name);
  return usual !== undefined && value !== null && typeof value === typeof usual[1];
}

/** Labels of what differs from one capture to the next; the others stay. */
const SUBJECT = ["cow", "teat"];

/** True if labels or note say of which cow a capture is. @param {Wish} wish */
export function namesSubject(wish) {
  return [...SUBJECT.map((name) => wish.labels[name] ?? ""), wish.note].some((text) => text.trim() !== "");
}

/** The wish for the next cow: whose she is, and the note, are empty. @param {Wish} wish @returns {Pick<Wish, "labels" | "note" | "of">} */
export function nextOf(wish) {
  const kept = Object.entries(wish.labels).filter(([name]) => !SUBJECT.includes(name));
  return { labels: Object.fromEntries(kept), note: "", of: "" };
}

/** Fields in one of what the length counts. @param {Wish} wish @param {number} rate_hz */
function fieldsOfOne(wish, rate_hz) {
  if (wish.kind === "fields") return 1;
  return wish.kind === "seconds" ? rate_hz : (60 * rate_hz) / wish.perMinute;
}

/** The length in fields, those before the start left out; null: until it is stopped. @param {Wish} wish @param {number} rate_hz */
export function lengthOf(wish, rate_hz) {
  return wish.kind === "stop" ? null : Math.round(wish[wish.kind] * fieldsOfOne(wish, rate_hz));
}

const MOST_FIELDS = 10_000_000;

/** Limits of what the length counts. @param {Wish} wish @param {number} rate_hz @returns {Limits} */
export function limitsOf(wish, rate_hz) {
  const one = fieldsOfOne(wish, rate_hz);
  return Number.isFinite(one) ? { least: 1 / one, most: MOST_FIELDS / one, isWhole: wish.kind === "fields" } : {};
}

/** True if a capture of this length can be requested. @param {Wish} wish @param {number} rate_hz */
export function isSound(wish, rate_hz) {
  const length = lengthOf(wish, rate_hz);
  return length === null || (length >= 1 && length <= MOST_FIELDS);
}

/**
 * The body of POST /captures, or /capture-groups.
 * @template {{device: string | undefined} | {devices: "all"}} Of
 * @param {Wish} wish
 * @param {Of} of the device, or all of them
 * @param {number} rate_hz
 */
export function requestOf(wish, of, rate_hz) {
  const length = lengthOf(wish, rate_hz);
  const labels = Object.fromEntries(Object.entries(wish.labels).filter(([, text]) => text.trim() !== ""));
  const common = { ...of, pre_trigger_fields: wish.before, labels, note: wish.note.trim() };
  if (wish.wait) return { ...common, armed: true, post_trigger_fields: length };
  return { ...common, fields: length === null ? null : length + wish.before };
}
