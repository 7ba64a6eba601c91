// From the object model's rows and columns to lines, triangles and normals.
import assert from "node:assert/strict";
import { test } from "node:test";
import { displacement, measuredMoment, momentOf } from "../../../../src/grabberd/server/web/static/js/scene/moments.js";
import { gridOf } from "../../../../src/grabberd/server/web/static/js/scene/grid.js";
import { cross, normalsOf, trianglesOf, wireOf } from "../../../../src/grabberd/server/web/static/js/scene/mesh.js";
import { PLAIN, scaleOf, sharesOf } from "../../../../src/grabberd/server/web/static/js/scene/quantities.js";
import { COLUMNS, objectDocument, pointsDocument, ROWS } from "./liner.mjs";

const grid = gridOf(objectDocument());

function facing(triangle, xyz) {
  const at = (i) => [0, 1, 2].map((axis) => xyz[3 * triangle[i] + axis]);
  const edge = (a, b) => at(b).map((part, axis) => part - at(a)[axis]);
  return cross(edge(0, 1), edge(0, 2))[2];
}

test("neighbours are those next to each other in a row or a column", () => {
  assert.equal(grid.edges.length, ROWS * (COLUMNS - 1) + (ROWS - 1) * COLUMNS);
  assert.equal(grid.cells.length, (ROWS - 1) * (COLUMNS - 1));
});

test("an object model as a capture keeps it makes the same grid", () => {
  const document = objectDocument();
  const targets = document.target.map((id, i) => ({
    id, row: document.row[i], column: document.column[i], x_mm: document.x_mm[i], y_mm: document.y_mm[i], z_mm: document.z_mm[i],
  }));
  assert.deepEqual(gridOf({ name: "liner", targets }), grid);
});

test("where all are seen every cell makes two triangles, all facing outward", () => {
  const triangles = trianglesOf(grid, grid.nominal_mm);
  assert.equal(triangles.length, 2 * grid.cells.length);
  assert.ok(triangles.every((triangle) => facing(triangle, grid.nominal_mm) > 0));
});

test("they face outward too where the columns are numbered the other way", () => {
  const document = objectDocument();
  const turned = gridOf({ ...document, column: document.column.map((column) => COLUMNS - 1 - column) });
  assert.equal(turned.outward, -grid.outward);
  assert.ok(trianglesOf(turned, turned.nominal_mm).every((triangle) => facing(triangle, turned.nominal_mm) > 0));
});

test("a missing target leaves a hole: of its cells half is left, and none of its edges", () => {
  const moment = measuredMoment(grid, pointsDocument([6]));
  const gone = grid.index.get(6);
  const triangles = trianglesOf(grid, moment.xyz_mm);
  assert.ok(triangles.every((triangle) => !triangle.includes(gone)));
  assert.equal(triangles.length, 2 * grid.cells.length - 4);
  assert.equal(wireOf(grid, moment.xyz_mm).length, grid.edges.length - 4);
});

test("normals are of length one and outward, and nought where there is no surface", () => {
  const moment = measuredMoment(grid, pointsDocument([1, 2, 5, 6, 9, 10]));
  const normals = normalsOf(trianglesOf(grid, moment.xyz_mm), moment.xyz_mm);
  for (const [i, id] of grid.target.entries()) {
    const length = Math.hypot(...normals.subarray(3 * i, 3 * i + 3));
    const seen = ![1, 2, 5, 6, 9, 10].includes(id);
    assert.ok(Math.abs(length - (seen ? 1 : 0)) < 1e-6);
    if (seen) assert.ok(normals[3 * i + 2] > 0);
  }
});

test("a moment has displacement from the nominal place and the points' σ", () => {
  const moment = measuredMoment(grid, pointsDocument([3]));
  assert.equal(moment.seen, grid.target.length - 1);
  const { displacement_mm, sigma_mm } = moment.values;
  assert.ok(Number.isNaN(displacement_mm[grid.index.get(3)]));
  assert.ok(Math.abs(displacement_mm[0] - 2) < 1e-5);
  assert.ok(Math.abs(sigma_mm[0] - 0.07) < 1e-6);
});

test("targets that the grid does not have, and places that are null, are passed over", () => {
  const columns = { target: [1, 2, 999], x_mm: [0, null, 0], y_mm: [0, null, 0], z_mm: [0, null, 0], strain1: [0.01, null, 0.5] };
  const moment = momentOf(grid, columns, ["strain1"], { phase: 0.25 });
  assert.equal(moment.seen, 1);
  assert.equal(moment.phase, 0.25);
  assert.deepEqual(Array.from(moment.values.strain1).filter(Number.isFinite).length, 1);
});

test("displacement of what is where it was is nought", () => {
  assert.deepEqual(Array.from(displacement(grid.nominal_mm, grid.nominal_mm)), Array(grid.target.length).fill(0));
});

test("strain is coloured in per cent round nought", () => {
  const columns = { target: [1, 2], x_mm: [0, 0], y_mm: [0, 0], z_mm: [0, 0], strain1: [-0.01, 0.03] };
  const moment = momentOf(grid, columns, ["strain1"]);
  const scale = scaleOf("strain1", [moment]);
  assert.ok(Math.abs(scale.high - 3) < 1e-5 && Math.abs(scale.low + 3) < 1e-5);
  const shares = sharesOf("strain1", scale, moment);
  assert.ok(Math.abs(shares[0] - 1 / 3) < 1e-5);
  assert.equal(shares[2], -1);
  assert.equal(sharesOf(PLAIN, null, moment)[0], -2);
});
