// A table of an analysis as it is served: numbers by column, missing ones null. Nothing here touches the page.

/** @typedef {(number | null)[]} Column */

/** @param {string} text of a CSV file of numbers @returns {Map<string, Column>} by name, in order */
export function tableOf(text) {
  const [head, ...rows] = text.trim().split(/\r?\n/).map((line) => line.split(","));
  return new Map(head.map((name, i) => [name, rows.map((row) => numberIn(row[i]))]));
}

/** @param {string | undefined} cell */
function numberIn(cell) {
  const value = cell ? Number(cell) : NaN;
  return Number.isFinite(value) ? value : null;
}

/**
 * Lines over one x that is the union of theirs; where a line has no value there is none.
 * @param {{x: Column, values: Column, sigma: Column}[]} lines
 * @returns {{columns: Column[], sigmas: Column[]}} x first
 */
export function together(lines) {
  const all = [...new Set(lines.flatMap(({ x }) => x))].filter((one) => one !== null).sort((a, b) => a - b);
  const over = (/** @type {Column} */ x, /** @type {Column} */ values) => {
    const known = new Map(x.map((one, i) => [one, values[i] ?? null]));
    return all.map((one) => known.get(one) ?? null);
  };
  return { columns: [all, ...lines.map(({ x, values }) => over(x, values))], sigmas: lines.map(({ x, sigma }) => over(x, sigma)) };
}
