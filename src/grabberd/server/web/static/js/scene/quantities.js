// The quantities that targets can be coloured by.
import { scaleOver, shareOf } from "./scale.js";

/** @import { Moment } from "./moments.js" */
/** @import { Scale } from "./scale.js" */

/**
 * @typedef {object} Quantity
 * @property {string} unit as it is shown
 * @property {number} factor from the API's unit to that
 * @property {boolean} signed nought has a meaning and is in the middle
 */

/** By the name of the API's column. @type {Record<string, Quantity>} */
export const QUANTITIES = {
  displacement_mm: { unit: "mm", factor: 1, signed: false },
  sigma_mm: { unit: "mm", factor: 1, signed: false },
  residual_px: { unit: "px", factor: 1, signed: false },
  strain1: { unit: "%", factor: 100, signed: true },
  strain2: { unit: "%", factor: 100, signed: true },
  tension1_n_per_m: { unit: "N/m", factor: 1, signed: false },
  contact_kpa: { unit: "kPa", factor: 1, signed: false },
};
export const PLAIN = "plain";

/**
 * The scale of a quantity over moments, in its shown unit.
 * @param {string} name
 * @param {Moment[]} moments
 */
export function scaleOf(name, moments) {
  const quantity = QUANTITIES[name];
  if (!quantity) return null;
  const all = moments.flatMap((moment) => Array.from(moment.values[name] ?? [], (value) => value * quantity.factor));
  return scaleOver(all, quantity.signed);
}

/**
 * Place of every target's value on the scale: −1 where it has none, −2 where no colour is wanted.
 * @param {string} name
 * @param {Scale | null} scale
 * @param {Moment} moment
 */
export function sharesOf(name, scale, moment) {
  const count = moment.xyz_mm.length / 3;
  if (name === PLAIN) return new Float32Array(count).fill(-2);
  const values = moment.values[name];
  if (!scale || !values) return new Float32Array(count).fill(-1);
  return Float32Array.from(values, (value) => shareOf(scale, value * QUANTITIES[name].factor));
}
