// The inputs of an analysis as they are filled in, and what is shown of an earlier one.
import assert from "node:assert/strict";
import { test } from "node:test";
import { ENDS, inputsOf, lacksOf, missingOf, valuesOf } from "../../../src/grabberd/web/static/js/analysis/inputs.js";
import { meanCycle } from "../../../src/grabberd/web/static/js/scene/capture_source.js";

const WALL = {
  material: "neo_hookean", "material.E_mpa": "3", "material.wall_mm": "2.5", "material.poisson": "0.5", "material.F0_n": "60",
  "material.radius_mm": "12.5", "material.target_mm": "0",
};
const HELD = { ...WALL, "material.first_end_mm": "-65", "material.last_end_mm": "65" };

test("the ends that hold the liner are part of its wall", () => {
  const { material } = inputsOf(HELD);
  assert.deepEqual([material.first_end_mm, material.last_end_mm], [-65, 65]);
  assert.deepEqual(valuesOf({ material }).values, HELD);
});

test("without both ends the wall is complete, but there is no pressure, and it is said", () => {
  const { "material.last_end_mm": _, ...one } = HELD;
  for (const values of [WALL, one]) {
    assert.deepEqual(missingOf(values, ""), []);
    assert.ok(lacksOf(values).includes(ENDS));
  }
  assert.ok(!lacksOf(HELD).includes(ENDS));
});

test("without a wall nobody is asked for its ends", () => {
  assert.ok(lacksOf({}).includes("material"));
  assert.ok(!lacksOf({}).includes(ENDS));
});

test("an earlier analysis without today's inputs is taken over as it is, its removed ones left out", () => {
  const { values } = valuesOf({ material: { law: "neo_hookean", E_mpa: 3 }, sought_kpa: 1, free_rows: [0, 6] });
  assert.deepEqual(values, { material: "neo_hookean", "material.E_mpa": "3", ".sought_kpa": "1" });
});

/** @param {boolean} outdated */
const quantitiesOf = async (outdated) => {
  const table = (name, values) => ({ columns: [{ name, values }] });
  const placed = { target: [1], x_mm: [0], y_mm: [0], z_mm: [0], contact_kpa: [3], strain1: [0.1], overpressure_kpa: [1] };
  const api = { get: async (path) => (path.includes("/maps") ? { field: null, phase: 0, units: {}, columns: placed } : { tables: { phases: table("phase", [0]), summary: table("period_s", [1]) } }) };
  const grid = { target: [1], index: new Map([[1, 0]]), nominal_mm: new Float32Array(3) };
  const opened = { capture: { id: "one" }, grid, analyses: [{ analysis: 1, outdated_pressure: outdated }] };
  return (await meanCycle(api, opened, 1)).quantities;
};

test("pressures of the earlier, wrong way do not colour the wall", async () => {
  assert.deepEqual(await quantitiesOf(false), ["contact_kpa", "strain1", "displacement_mm"]);
  assert.deepEqual(await quantitiesOf(true), ["strain1", "displacement_mm"]);
});
