// The points of one moment, in the order of the target grid.

/** @import { Grid } from "./grid.js" */
/** @import { FieldPoints } from "types/documents" */
/** @import { StreamedPoints } from "../live/points_message.js" */
/** @import { PlacedColumns } from "types/open_documents" */

/**
 * @typedef {object} Moment
 * @property {number | null} n number of the field; null for a phase of the mean cycle
 * @property {number | null} time_s since the capture's first field
 * @property {number | null} phase of the mean cycle
 * @property {string | null} utc
 * @property {Float32Array} xyz_mm x, y, z of every target in turn, NaN where it was not seen
 * @property {number} seen how many were
 * @property {Record<string, Float32Array>} values of every target, by quantity, NaN where there is none
 */

/**
 * A moment from columns with a `target` each.
 * @template {string} Name
 * @param {Grid} grid
 * @param {PlacedColumns & Record<Name, (number | null)[]>} columns
 * @param {Name[]} names of the columns that are values to colour by
 * @param {Partial<Moment>} [when]
 * @returns {Moment}
 */
export function momentOf(grid, columns, names, when = {}) {
  const count = grid.target.length;
  const xyz_mm = new Float32Array(3 * count).fill(NaN);
  const values = Object.fromEntries(names.map((name) => [name, new Float32Array(count).fill(NaN)]));
  let seen = 0;
  for (const [i, id] of columns.target.entries()) {
    const place = grid.index.get(id);
    const [x, y, z] = [columns.x_mm[i], columns.y_mm[i], columns.z_mm[i]];
    if (place === undefined || x === null || y === null || z === null) continue;
    xyz_mm.set([x, y, z], 3 * place);
    for (const name of names) values[name][place] = columns[name][i] ?? NaN;
    seen += 1;
  }
  return { n: null, time_s: null, phase: null, utc: null, ...when, xyz_mm, values, seen };
}

/**
 * A moment of measured points: with their displacement from their nominal places and their σ.
 * @param {Grid} grid
 * @param {FieldPoints | StreamedPoints} field of a points document, or of the stream
 * @returns {Moment}
 */
export function measuredMoment(grid, field) {
  const when = "utc" in field ? { n: field.n, utc: field.utc } : { n: field.n, time_s: field.time_s };
  const moment = momentOf(grid, field, ["residual_px"], when);
  const sigma = momentOf(grid, { ...field, sigma_mm: spread(field) }, ["sigma_mm"]).values.sigma_mm;
  return { ...moment, values: { ...moment.values, sigma_mm: sigma, displacement_mm: displacement(moment.xyz_mm, grid.nominal_mm) } };
}

/** Distance of every target from its place in a reference. @param {Float32Array} xyz_mm @param {Float32Array} reference_mm */
export function displacement(xyz_mm, reference_mm) {
  return Float32Array.from({ length: xyz_mm.length / 3 }, (_, i) => {
    const along = (/** @type {number} */ axis) => xyz_mm[3 * i + axis] - reference_mm[3 * i + axis];
    return Math.hypot(along(0), along(1), along(2));
  });
}

/** σ of the place, from pointing and line jitter: root of the sum over the axes. @param {FieldPoints | StreamedPoints} field @returns {number[]} */
function spread(field) {
  return field.sigma_x_mm.map((x, i) => Math.hypot(x, field.sigma_y_mm[i], field.sigma_z_mm[i]));
}
