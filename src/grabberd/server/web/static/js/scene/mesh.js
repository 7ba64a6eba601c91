// Lines and triangles between neighbouring targets that were seen; where one is missing there is a hole.

/** @import { Grid } from "./grid.js" */

/** True if a target has a place. @param {Float32Array} xyz @param {number} i */
export const isSeen = (xyz, i) => Number.isFinite(xyz[3 * i]);

/** The edges between targets that were both seen. @param {Grid} grid @param {Float32Array} xyz */
export function wireOf(grid, xyz) {
  return grid.edges.filter(([a, b]) => isSeen(xyz, a) && isSeen(xyz, b));
}

/**
 * Triangles, counter-clockwise as seen from outside: two for a cell of four, one where one of four is missing.
 * @param {Grid} grid
 * @param {Float32Array} xyz
 * @returns {[number, number, number][]}
 */
export function trianglesOf(grid, xyz) {
  const found = grid.cells.flatMap((cell) => split(cell.filter((i) => isSeen(xyz, i)), xyz));
  return grid.outward > 0 ? found : found.map(([a, b, c]) => [a, c, b]);
}

/**
 * Normals, outward, of every target: the mean of its triangles' by their area; nought where it has none.
 * @param {[number, number, number][]} triangles
 * @param {Float32Array} xyz
 */
export function normalsOf(triangles, xyz) {
  const normals = new Float32Array(xyz.length);
  for (const triangle of triangles) {
    const normal = cross(edge(xyz, triangle[0], triangle[1]), edge(xyz, triangle[0], triangle[2]));
    for (const i of triangle) for (const axis of [0, 1, 2]) normals[3 * i + axis] += normal[axis];
  }
  for (let i = 0; i < normals.length; i += 3) normals.set(unit([normals[i], normals[i + 1], normals[i + 2]]), i);
  return normals;
}

/** Along the shorter diagonal, which follows the surface better. @param {number[]} corners @param {Float32Array} xyz @returns {[number, number, number][]} */
function split(corners, xyz) {
  if (corners.length < 3) return [];
  const [a, b, c, d] = corners;
  if (d === undefined) return [[a, b, c]];
  return Math.hypot(...edge(xyz, a, c)) <= Math.hypot(...edge(xyz, b, d)) ? [[a, b, c], [a, c, d]] : [[a, b, d], [b, c, d]];
}

/** @param {Float32Array} xyz @param {number} from @param {number} to @returns {number[]} */
function edge(xyz, from, to) {
  return [0, 1, 2].map((axis) => xyz[3 * to + axis] - xyz[3 * from + axis]);
}

/** @param {number[]} a @param {number[]} b */
export function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

/** @param {number[]} vector */
export function unit(vector) {
  const length = Math.hypot(...vector) || 1;
  return vector.map((part) => part / length);
}
