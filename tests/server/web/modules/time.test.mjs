// How samples become lines with gaps.
import assert from "node:assert/strict";
import { test } from "node:test";
import { pairOf } from "../../../../src/grabberd/server/web/static/js/plots/facing_pair.js";
import { columnsOf, csvOf, summaryOf } from "../../../../src/grabberd/server/web/static/js/plots/series.js";

test("a pause becomes a gap, and so does a missing value", () => {
  const samples = [{ time_s: 0, x: 1 }, { time_s: 0.2, x: null }, { time_s: 5, x: 2 }];
  assert.deepEqual(columnsOf(samples, [(sample) => sample.x], 1), [[0, 0.2, 0.7, 5], [1, null, null, 2]]);
});

test("a summary passes over gaps", () => {
  assert.deepEqual(summaryOf([null, 2, 6, null]), { least: 2, greatest: 6, mean: 4, last: 6 });
  assert.equal(summaryOf([null]), null);
});

test("a CSV file has a line of names, and empty places where nothing was seen", () => {
  assert.equal(csvOf(["time_s", "x_mm"], [[0, 1], [null, 2.5]]), "time_s,x_mm\n0,\n1,2.5\n");
});

test("the width is drawn of the outermost targets that are seen most of the time", () => {
  const seen = { width_mm: 20, sigma_mm: 0.1 };
  const not = { width_mm: null, sigma_mm: null };
  const samples = Array.from({ length: 20 }, (_, i) => ({ widths: [i % 4 ? not : seen, seen, seen] }));
  assert.equal(pairOf(samples), 1);
  assert.equal(pairOf([{ widths: [not] }]), -1);
  assert.equal(pairOf([]), -1);
});
