// The target grid of an object model: which targets there are, and which are neighbours.

/** @import { ObjectModel, StoredObject } from "types/documents" */

/**
 * @typedef {object} Grid
 * @property {string} name of the object
 * @property {number[]} target ids
 * @property {Map<number, number>} index where an id stands in every list
 * @property {number[]} row of the target grid
 * @property {number[]} column
 * @property {Float32Array} nominal_mm x, y, z of every target in turn
 * @property {[number, number][]} edges pairs of neighbours
 * @property {[number, number, number, number][]} cells four neighbours each, one after the other round
 * @property {number} outward 1 where the cells run counter-clockwise as seen from outside (+z), or −1
 */

/**
 * From an object model of the API (lists), or one as a capture keeps it (`targets`).
 * @param {ObjectModel | StoredObject} document
 * @returns {Grid}
 */
export function gridOf(document) {
  const { target, row, column, xyz } = "targets" in document ? listed(document.targets) : columns(document);
  const nominal_mm = Float32Array.from(xyz.flat());
  const at = places(row, column);
  const cells = cellsOf(row, column, at);
  return {
    name: document.name ?? "",
    target, row, column, nominal_mm, cells,
    index: new Map(target.map((id, i) => [id, i])),
    edges: edgesOf(row, column, at),
    outward: outwardOf(nominal_mm, cells),
  };
}

/** @param {StoredObject["targets"]} targets */
function listed(targets) {
  return {
    target: targets.map((one) => one.id),
    row: targets.map((one) => one.row),
    column: targets.map((one) => one.column),
    xyz: targets.map((one) => [one.x_mm, one.y_mm, one.z_mm]),
  };
}

/** @param {ObjectModel} document */
function columns(document) {
  const { target, row, column, x_mm, y_mm, z_mm } = document;
  return { target, row, column, xyz: x_mm.map((x, i) => [x, y_mm[i], z_mm[i]]) };
}

/** @param {number} row @param {number} column */
const key = (row, column) => `${row} ${column}`;

/** @param {number[]} row @param {number[]} column */
function places(row, column) {
  return new Map(row.map((one, i) => [key(one, column[i]), i]));
}

/** @param {number[]} row @param {number[]} column @param {Map<string, number>} at @returns {[number, number][]} */
function edgesOf(row, column, at) {
  const beside = (/** @type {number} */ i) => [at.get(key(row[i] + 1, column[i])), at.get(key(row[i], column[i] + 1))];
  return row.flatMap((_, i) =>
    beside(i).flatMap((other) => (other === undefined ? [] : [/** @type {[number, number]} */ ([i, other])])),
  );
}

/** @param {number[]} row @param {number[]} column @param {Map<string, number>} at @returns {[number, number, number, number][]} */
function cellsOf(row, column, at) {
  return row.flatMap((r, i) => {
    const c = column[i];
    const four = [i, at.get(key(r + 1, c)), at.get(key(r + 1, c + 1)), at.get(key(r, c + 1))];
    return four.includes(undefined) ? [] : [/** @type {[number, number, number, number]} */ (four)];
  });
}

/** @param {Float32Array} xyz @param {[number, number, number, number][]} cells */
function outwardOf(xyz, cells) {
  const across = (/** @type {number} */ a, /** @type {number} */ b, /** @type {number} */ i) => xyz[3 * b + i] - xyz[3 * a + i];
  const upward = cells.reduce((sum, [a, b, c, d]) => sum + across(a, c, 0) * across(b, d, 1) - across(a, c, 1) * across(b, d, 0), 0);
  return upward < 0 ? -1 : 1;
}
