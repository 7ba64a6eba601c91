// The quantities of the maps: unit, digits, and whether zero is in the middle of the colours.

/** @import { Context } from "../core/context.js" */

/** @typedef {{name: string, unit: string, times: number, digits: number, signed: boolean}} Quantity */

/** @type {Quantity[]} */
export const QUANTITIES = [
  { name: "contact_kpa", unit: "kPa", times: 1, digits: 1, signed: true },
  { name: "above_atmosphere_kpa", unit: "kPa", times: 1, digits: 1, signed: true },
  { name: "strain1", unit: "%", times: 100, digits: 1, signed: true },
  { name: "strain2", unit: "%", times: 100, digits: 1, signed: true },
  { name: "tension1_n_per_m", unit: "N/m", times: 1, digits: 0, signed: true },
  { name: "tension2_n_per_m", unit: "N/m", times: 1, digits: 0, signed: true },
  { name: "kappa1_per_m", unit: "1/m", times: 1, digits: 1, signed: true },
  { name: "kappa2_per_m", unit: "1/m", times: 1, digits: 1, signed: true },
];

/** Values in the unit that is shown. @param {Quantity} quantity @param {(number | null)[]} values */
export const shown = (quantity, values) => values.map((value) => (value === null || value === undefined ? null : value * quantity.times));

/** Reason for a missing value, in the page's own words where it knows the daemon's. @param {Context} context @param {string} reason */
export function reasonIn({ t, texts, format }, reason) {
  const vague = /^σ of (\S+) kPa exceeds the pressure sought \((\S+) kPa\)$/.exec(reason);
  if (vague) return t("analysis.reason.vague", { sigma: format.number(Number(vague[1]), 1), sought: format.number(Number(vague[2]), 1) });
  const slug = reason.replace(/\W+/g, "_");
  return texts.has(`analysis.reason.${slug}`) ? t(`analysis.reason.${slug}`) : reason;
}
