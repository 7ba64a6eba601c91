// Numbers as they are typed, and files as spreadsheets write them.
import assert from "node:assert/strict";
import { test } from "node:test";
import { inputsOf, missingOf } from "../../../../src/grabberd/server/web/static/js/analysis/inputs.js";
import { numberOf, problemOf } from "../../../../src/grabberd/server/web/static/js/core/number.js";
import { textOf } from "../../../../src/grabberd/server/web/static/js/core/text_file.js";
import { isSound, lengthOf, limitsOf, USUAL } from "../../../../src/grabberd/server/web/static/js/operate/wish.js";

test("a comma and a point are decimal signs", () => {
  for (const [typed, value] of [["2,5", 2.5], ["2.5", 2.5], [" 3 ", 3], ["-3", -3], ["−0,5", -0.5], [",5", 0.5], ["2,", 2], ["1e-7", 1e-7]]) assert.equal(numberOf(typed), value, typed);
  for (const nothing of ["", "  ", undefined]) assert.equal(numberOf(nothing), null);
});

test("what is no number is not made one", () => {
  for (const typed of ["two", "1 000", "1.000,5", "1,000,000", "1_000", "0x10", "1e999", "Infinity", "2,5 s", "-", ","]) {
    assert.ok(Number.isNaN(numberOf(typed)), typed);
    assert.equal(problemOf(typed), "none", typed);
  }
});

test("the true reason is told", () => {
  const limits = { least: 0, most: 10, isWhole: true };
  for (const [typed, problem] of [["2,5", "whole"], ["3,000", "whole"], ["-3", "least"], ["11", "most"], ["10", null], ["", null]]) assert.equal(problemOf(typed, limits), problem, typed);
});

test("a length is neither rounded nor moved to a limit", () => {
  assert.equal(lengthOf({ ...USUAL, seconds: 2.5 }, 50), 125);
  for (const wish of [{ seconds: -3 }, { seconds: 0 }, { seconds: NaN }, { kind: "cycles", cycles: -1 }, { kind: "cycles", perMinute: NaN }, { kind: "fields", fields: 0 }]) assert.equal(isSound({ ...USUAL, ...wish }, 50), false, JSON.stringify(wish));
  assert.deepEqual(limitsOf({ ...USUAL, kind: "fields" }, 50), { least: 1, most: 10_000_000, isWhole: true });
  assert.deepEqual(limitsOf(USUAL, 50), { least: 0.02, most: 200_000, isWhole: false });
  assert.deepEqual(limitsOf({ ...USUAL, kind: "cycles", perMinute: NaN }, 50), {});
});

test("inputs of an analysis have the numbers that were typed, and those that are none are missing", () => {
  const values = { ".sought_kpa": "2,5", ".height1": "-30", ".phases": "" };
  assert.deepEqual([inputsOf(values), missingOf(values, "")], [{ sought_kpa: 2.5, heights_mm: [-30] }, []]);
  assert.deepEqual(missingOf({ ".sought_kpa": "2,5 kPa" }, ""), [".sought_kpa"]);
});

test("a file is read by its byte order mark, and refused in another encoding", async () => {
  const text = "time_s;µ\n";
  const utf16 = (/** @type {boolean} */ little) => {
    const view = new DataView(new ArrayBuffer(2 * text.length + 2));
    ["\ufeff", ...text].forEach((letter, i) => view.setUint16(2 * i, letter.charCodeAt(0), little));
    return view;
  };
  for (const content of [text, `\ufeff${text}`, utf16(true), utf16(false)]) assert.equal(await textOf(new Blob([content])), text);
  await assert.rejects(textOf(new Blob([new Uint8Array([0x74, 0xb5])])), TypeError);
});
