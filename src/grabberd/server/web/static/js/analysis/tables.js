// Columns out of an analysis' document.

/** @import { Table } from "types/documents" */

/** @typedef {(number | null)[]} Column */

/** The values of a column of numbers; none where there is no such column. @param {Table | undefined} table @param {string} name */
export function column(table, name) {
  return /** @type {Column} */ (table?.columns.find((one) => one.name === name)?.values ?? []);
}

/** The texts of a column; none where there is no such column. @param {Table | undefined} table @param {string} name */
export function words(table, name) {
  return /** @type {string[]} */ (table?.columns.find((one) => one.name === name)?.values ?? []);
}

/** The value of the only row of a table, with its σ. @param {Table | undefined} table @param {string} name */
export function single(table, name) {
  return { value: column(table, name)[0] ?? null, sigma: column(table, `sigma_${name}`)[0] ?? null };
}

/** True if a column has any value. @param {Column} values */
export const hasAny = (values) => values.some((value) => Number.isFinite(value));

/** Values around which a band of one σ lies: value, value + σ, value − σ. @param {Column} values @param {Column} sigma @returns {[Column, Column, Column]} */
export function banded(values, sigma) {
  const shifted = (/** @type {number} */ by) => values.map((value, i) => (value === null || sigma[i] === null || sigma[i] === undefined ? null : value + by * /** @type {number} */ (sigma[i])));
  return [values, shifted(1), shifted(-1)];
}
