// The inputs of an analysis as they are filled in, and what is shown of an earlier one.
import assert from "node:assert/strict";
import { test } from "node:test";
import { inputsOf, missingOf, valuesOf } from "../../../../src/grabberd/server/web/static/js/analysis/inputs.js";
import { createMapSource } from "../../../../src/grabberd/server/web/static/js/replay/map_source.js";

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

test("without both ends the wall is complete", () => {
  const { "material.last_end_mm": _, ...one } = HELD;
  for (const values of [WALL, one]) assert.deepEqual(missingOf(values, ""), []);
});

test("an earlier analysis without today's inputs is taken over as it is, its removed ones left out", () => {
  const { values } = valuesOf({ material: { law: "neo_hookean", E_mpa: 3 }, sought_kpa: 1, free_rows: [0, 6] });
  assert.deepEqual(values, { material: "neo_hookean", "material.E_mpa": "3", ".sought_kpa": "1" });
});

test("a light in the picture relates the clocks, and needs no number", () => {
  const values = { "vacuum.pulsation": "log", "vacuum.liner": "log", "vacuum.clock": "light" };
  const { vacuum } = inputsOf(values);
  assert.deepEqual(vacuum, { pulsation: "log", liner: "log", offset: "light" });
  assert.deepEqual(missingOf(values, "time_s,…"), []);
  assert.deepEqual(valuesOf({ vacuum }).values, values);
});

test("a known offset and a known lag keep their numbers", () => {
  for (const clock of [{ offset: { s: 12.3, sigma_s: 0.01 } }, { lag: { opening_s: 0.02, closing_s: 0.03, sigma_s: 0.005, near_s: 12 } }]) assert.deepEqual(inputsOf(valuesOf({ vacuum: clock }).values).vacuum, clock);
});

test("the capture's own channels are taken over, and no file is asked for", () => {
  const { values, dropped } = valuesOf({ vacuum: { pulsation: "channel", liner: { kpa: 42, sigma_kpa: 0.5 } } });
  assert.deepEqual(inputsOf(values).vacuum, { pulsation: "channel", liner: { kpa: 42, sigma_kpa: 0.5 } });
  assert.deepEqual([missingOf(values, ""), dropped], [[], []]);
});

/** @param {boolean} outdated */
function mapsOf(outdated) {
  const table = (columns) => ({ columns: Object.entries(columns).map(([name, values]) => ({ name, values })) });
  const tables = { fields: table({ n: [4, 5], phase: [0.1, 0.6] }), phases: table({ phase: [0, 0.5] }) };
  const document = { tables, states: [{ targets: table({ contact_kpa: [3], strain1: [0.1] }) }] };
  const asked = [];
  const api = { get: async (path) => { asked.push(path.split("?")[1]); return { path }; } };
  return { asked, source: createMapSource(api, "one", { row: { analysis: 1, outdated_pressure: outdated }, document }, () => {}) };
}

test("pressures of the earlier, wrong way do not colour the wall", () => {
  assert.deepEqual(mapsOf(false).source.quantities.map(({ name }) => name), ["contact_kpa", "strain1"]);
  assert.deepEqual(mapsOf(true).source.quantities.map(({ name }) => name), ["strain1"]);
});

test("a map is that of the field itself, or of the nearest phase of its cycle", async () => {
  const { asked, source } = mapsOf(false);
  source.want("field", [5, 6]);
  source.want("phase", [5]);
  await new Promise((resolve) => setImmediate(resolve));
  assert.deepEqual(asked, ["field=5", "phase=0.5"]);
  assert.match(source.at("field", 5).path, /field=5/);
  assert.match(source.at("phase", 5).path, /phase=0.5/);
  assert.deepEqual([source.at("field", 4), source.at("field", 6)], [undefined, null]);
});
