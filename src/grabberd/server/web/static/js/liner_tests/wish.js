// What is filled in before a guided test's capture, and the request that it makes. Nothing here touches the page.
import { numberOf } from "../core/number.js";

/** @import { Recipe } from "types/documents" */

/**
 * @typedef {object} Wish
 * @property {string} liner name of its profile, or another
 * @property {Record<string, string>} labels of other profiles, by their kind
 * @property {Record<string, string>} numbers as they were typed, by the label that they become
 */

/** @type {Wish} */
export const NOTHING = { liner: "", labels: {}, numbers: {} };
/** As the daemon takes the name of a profile. */
const NAME = /^[\p{L}\p{M}\p{N}_](?:[\p{L}\p{M}\p{N}_ .-]{0,62}[\p{L}\p{M}\p{N}_.-])?$/u;
export const OTHERS = /** @type {const} */ (["pulsator", "cup", "cow"]);

/**
 * @typedef {object} Asked a number that a recipe asks for
 * @property {string} name the label that it becomes
 * @property {string} unit
 * @property {boolean} needed
 * @property {number} step
 */

/** @param {string} name @param {string} unit @param {number} step @param {boolean} [needed] @returns {Asked} */
const asked = (name, unit, step, needed = false) => ({ name, unit, step, needed });

/** @type {Record<Recipe["kind"], Asked[]>} */
export const NUMBERS = {
  reference: [asked("unmounted_pitch_mm", "mm", 0.1)],
  ramp: [asked("milkings", "", 100)],
  milking: [asked("milkings", "", 100)],
  "artificial-teat": [asked("known_kpa", "kPa", 2, true), asked("known_sigma_kpa", "kPa", 0.1)],
  overpressure: [],
  wear: [],
};

/** A wish that was kept; what is of another form, as an older edition of the page may have left it, is passed over. @param {unknown} kept @returns {Wish} */
export function wishFrom(kept) {
  const { liner, labels, numbers } = /** @type {Record<string, unknown>} */ (kept !== null && typeof kept === "object" ? kept : {});
  return { liner: typeof liner === "string" ? liner : "", labels: textsIn(labels), numbers: textsIn(numbers) };
}

/** @param {unknown} kept @returns {Record<string, string>} */
function textsIn(kept) {
  const entries = Object.entries(kept !== null && typeof kept === "object" ? kept : {});
  return Object.fromEntries(entries.filter(([, value]) => typeof value === "string"));
}

/** Name of what keeps a capture from being started; null: nothing does. @param {Recipe["kind"]} kind @param {Wish} wish @returns {string | null} */
export function missingIn(kind, wish) {
  if (!wish.liner.trim()) return "liner";
  if (!NAME.test(wish.liner.trim())) return "name";
  const wrong = NUMBERS[kind].find(({ name, needed }) => {
    const value = numberOf(wish.numbers[name]);
    return value === null ? needed : !Number.isFinite(value) || value < 0;
  });
  return wrong?.name ?? null;
}

/** The body of POST /captures. @param {Recipe} recipe @param {Wish} wish @param {string | undefined} device */
export function requestOf({ kind, bits, duration_s }, wish, device) {
  const numbers = NUMBERS[kind].flatMap(({ name }) => {
    const value = numberOf(wish.numbers[name]);
    return value === null ? [] : [[name, String(value)]];
  });
  const others = OTHERS.flatMap((one) => (wish.labels[one] ? [[one, wish.labels[one]]] : []));
  return { device, bits: /** @type {1 | 8} */ (bits), duration_s, labels: { test: kind, liner: wish.liner.trim(), ...Object.fromEntries([...others, ...numbers]) } };
}
