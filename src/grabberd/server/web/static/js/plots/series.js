// Samples as columns for a chart; where something is missing, a gap.

/** @typedef {(number | null)[]} Column */

/**
 * The times and what is picked of every sample, with an empty row where longer than `most_s` nothing came.
 * @template {{time_s: number}} Sample
 * @param {Sample[]} samples in order
 * @param {((sample: Sample) => number | null | undefined)[]} picks
 * @param {number} most_s
 * @returns {Column[]} times first
 */
export function columnsOf(samples, picks, most_s) {
  /** @type {Column[]} */
  const columns = [[], ...picks.map(() => [])];
  let before_s = Infinity;
  for (const sample of samples) {
    if (sample.time_s - before_s > most_s) add(columns, before_s + most_s / 2, picks.map(() => null));
    add(columns, sample.time_s, picks.map((pick) => finite(pick(sample))));
    before_s = sample.time_s;
  }
  return columns;
}

/** Least, greatest, mean and last of what is known of a column; null where nothing is. @param {Column} column */
export function summaryOf(column) {
  const known = /** @type {number[]} */ (column.filter((value) => value !== null));
  if (!known.length) return null;
  return {
    least: known.reduce((a, b) => Math.min(a, b)),
    greatest: known.reduce((a, b) => Math.max(a, b)),
    mean: known.reduce((a, b) => a + b) / known.length,
    last: known[known.length - 1],
  };
}

/** As a CSV file; what is missing is empty. @param {string[]} names @param {Column[]} columns */
export function csvOf(names, columns) {
  const rows = columns[0].map((_, i) => columns.map((column) => column[i] ?? "").join(","));
  return [names.join(","), ...rows, ""].join("\n");
}

/** @param {Column[]} columns @param {number} time_s @param {(number | null)[]} values */
function add(columns, time_s, values) {
  columns[0].push(time_s);
  values.forEach((value, i) => columns[i + 1].push(value));
}

/** @param {number | null | undefined} value */
const finite = (value) => (Number.isFinite(value) ? /** @type {number} */ (value) : null);
