// Values as colours, and which values the colours stand for.
import assert from "node:assert/strict";
import { test } from "node:test";
import { colourAt, css, MAPS } from "../../../../src/grabberd/server/web/static/js/scene/colours.js";
import { digitsOf, scaleOver, shareOf, ticks, together } from "../../../../src/grabberd/server/web/static/js/scene/scale.js";

const lightness = ([red, green, blue]) => 0.2126 * red ** 2.2 + 0.7152 * green ** 2.2 + 0.0722 * blue ** 2.2;

test("a rising map grows lighter all the way, so it is read without its hues", () => {
  const steps = Array.from({ length: 101 }, (_, i) => lightness(colourAt("rising", i / 100)));
  steps.slice(1).forEach((step, i) => assert.ok(step > steps[i], `at ${i} %`));
});

test("a signed map is lightest at nought and equally dark at both ends", () => {
  const at = (share) => lightness(colourAt("signed", share));
  for (const share of [0, 0.2, 0.4]) {
    assert.ok(at(share) < at(0.5) && at(1 - share) < at(0.5));
    assert.ok(Math.abs(at(share) - at(1 - share)) < 0.06);
  }
});

test("both have seventeen colours, as the graphics processor expects", () => {
  for (const map of Object.values(MAPS)) assert.equal(map.length, 17);
});

test("beyond its ends a map has the outermost colours", () => {
  assert.deepEqual(colourAt("rising", -3), MAPS.rising[0]);
  assert.deepEqual(colourAt("rising", 7), MAPS.rising[16]);
  assert.equal(css([1, 0, 0.5]), "rgb(255 0 128)");
});

test("a scale passes over what is missing, and over the outermost two in a hundred", () => {
  const values = Array.from({ length: 101 }, (_, i) => i);
  assert.deepEqual(scaleOver([...values, NaN, Infinity], false), { low: 2, high: 98, map: "rising" });
  assert.equal(scaleOver([NaN], false), null);
});

test("a signed scale has nought in the middle", () => {
  assert.deepEqual(scaleOver([-1, 3], true), { low: -3, high: 3, map: "signed" });
});

test("equal values still make a scale", () => {
  const scale = scaleOver([5, 5, 5], false);
  assert.ok(scale.high > scale.low);
  assert.equal(shareOf(scale, 5), 0);
});

test("a value's share of a scale is from nought to one, and minus one where there is none", () => {
  const scale = { low: 2, high: 4, map: "rising" };
  assert.deepEqual([1, 2, 3, 4, 9, NaN].map((value) => shareOf(scale, value)), [0, 0, 0.5, 1, 1, -1]);
});

test("two scales together have both", () => {
  const one = { low: 0, high: 1, map: "rising" };
  assert.deepEqual(together(one, { low: -1, high: 0.5, map: "rising" }), { low: -1, high: 1, map: "rising" });
  assert.equal(together(null, one), one);
  assert.equal(together(one, null), one);
});

test("ticks are round and few", () => {
  assert.deepEqual(ticks(0.02, 4.45, 5), [1, 2, 3, 4]);
  assert.deepEqual(ticks(-30, 30), [-30, -20, -10, 0, 10, 20, 30]);
  for (const [low, high] of [[0, 1], [-0.003, 0.017], [1e4, 3.3e4], [0.1, 0.11]]) {
    const marks = ticks(low, high);
    assert.ok(marks.length >= 3 && marks.length <= 7, `${marks}`);
    assert.ok(marks.every((mark) => mark >= low - 1e-9 && mark <= high + 1e-9));
  }
});

test("as many digits are shown as tell them apart", () => {
  assert.equal(digitsOf([1, 2, 3]), 0);
  assert.equal(digitsOf([19.25, 19.5, 19.75]), 2);
  assert.equal(digitsOf([0.05, 0.1]), 2);
  assert.equal(digitsOf([100, 200]), 0);
});
