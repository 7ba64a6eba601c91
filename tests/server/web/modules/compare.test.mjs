// Captures compared: what belongs together, and how their curves are laid over each other.
import assert from "node:assert/strict";
import { test } from "node:test";
import { tableOf, together } from "../../../../src/grabberd/server/web/static/js/compare/csv_table.js";
import { groupings, labelsOf, usualGrouping } from "../../../../src/grabberd/server/web/static/js/compare/grouping.js";

/** @param {...Record<string, string>} labels */
const captures = (...labels) => labels.map((one, i) => ({ id: String(i), labels: one }));

test("a label of which a group has several captures is what is tested, the liner first", () => {
  const four = captures({ liner: "A", cow: "1" }, { liner: "A", cow: "2" }, { liner: "B", cow: "1" }, { liner: "B", cow: "2" });
  assert.equal(usualGrouping(four), "liner");
  assert.deepEqual(labelsOf(four), ["liner", "cow"]);
});

test("a label that some lack, or that each has for itself, tests nothing", () => {
  assert.equal(usualGrouping(captures({ liner: "A" }, { liner: "B" })), "id");
  assert.equal(usualGrouping(captures({ liner: "A" }, { liner: "A" }, { liner: "B" }, {})), "id");
});

test("many captures are not compared one with another", () => {
  const many = captures(...Array.from({ length: 7 }, () => ({ liner: "A" })));
  assert.equal(usualGrouping(many), "");
  assert.ok(!groupings(many).includes("id"));
});

test("a served table is read by columns, and what is missing is no number", () => {
  const table = tableOf("phase,width_mm,sigma_width_mm\r\n0,9.5,0.01\r\n0.5,,\r\n");
  assert.deepEqual([...table], [["phase", [0, 0.5]], ["width_mm", [9.5, null]], ["sigma_width_mm", [0.01, null]]]);
});

test("curves with places of their own keep their own values", () => {
  const one = { x: [0, 0.5], values: [1, 2], sigma: [0.1, 0.2] };
  const other = { x: [0, 0.25], values: [3, 4], sigma: [] };
  const { columns, sigmas } = together([one, other]);
  assert.deepEqual(columns, [[0, 0.25, 0.5], [1, null, 2], [3, 4, null]]);
  assert.deepEqual(sigmas, [[0.1, null, 0.2], [null, null, null]]);
});
