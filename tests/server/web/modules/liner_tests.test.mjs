// What a guided test's capture is asked for with, what its conditions are, and whether an offer is stored.
import assert from "node:assert/strict";
import { test } from "node:test";
import { conditionsOf } from "../../../../src/grabberd/server/web/static/js/liner_tests/conditions.js";
import { isSame } from "../../../../src/grabberd/server/web/static/js/liner_tests/offer.js";
import { missingIn, NOTHING, requestOf, wishFrom } from "../../../../src/grabberd/server/web/static/js/liner_tests/wish.js";

const RAMP = { kind: "ramp", bits: 8, duration_s: 60, several: false, pulsates: null, teat: false };
const REFERENCE = { ...RAMP, kind: "reference", duration_s: 2, pulsates: false };
const TEAT = { ...REFERENCE, kind: "artificial-teat", several: true, teat: true };
const MILKING = { ...RAMP, kind: "milking", bits: 1, pulsates: true, teat: true };

test("the capture is labelled with test, liner, other profiles and numbers", () => {
  const wish = { liner: " A ", labels: { pulsator: "north", cow: "" }, numbers: { milkings: "1200", known_kpa: "4" } };
  assert.deepEqual(requestOf(RAMP, wish, "barn"), { device: "barn", bits: 8, duration_s: 60, labels: { test: "ramp", liner: "A", pulsator: "north", milkings: "1200" } });
});

test("a number is typed as in either language, and zero is one", () => {
  const wish = { ...NOTHING, liner: "A", numbers: { known_kpa: "2,5", known_sigma_kpa: " " } };
  assert.deepEqual(requestOf(TEAT, wish, undefined).labels, { test: "artificial-teat", liner: "A", known_kpa: "2.5" });
  assert.equal(missingIn("artificial-teat", { ...wish, numbers: { known_kpa: "0" } }), null);
});

test("what is missing or no number is named", () => {
  assert.equal(missingIn("ramp", NOTHING), "liner");
  assert.equal(missingIn("artificial-teat", { ...NOTHING, liner: "A" }), "known_kpa");
  for (const typed of ["two", "-2", "1e999"]) assert.equal(missingIn("artificial-teat", { liner: "A", labels: {}, numbers: { known_kpa: typed } }), "known_kpa");
  assert.equal(missingIn("ramp", { liner: "A", labels: {}, numbers: { milkings: "many" } }), "milkings");
  assert.equal(missingIn("ramp", { liner: "A", labels: {}, numbers: { known_kpa: "many" } }), null, "another test asked for that");
});

test("a liner has a name that its profile may have", () => {
  for (const liner of ["Blåros 2", "A", "112", "no-4.b"]) assert.equal(missingIn("ramp", { ...NOTHING, liner }), null);
  for (const liner of ["a/b", "-a", "x".repeat(65), "a\nb"]) assert.equal(missingIn("ramp", { ...NOTHING, liner }), "name");
});

test("what was kept in another form is passed over", () => {
  for (const nothing of [null, 7, "A", { liner: 3, labels: [1], numbers: null }]) assert.deepEqual(wishFrom(nothing), NOTHING);
});

const DEVICE = { name: "barn", state: "ready", health: { start: "possible" }, lacks: [], live: { views: { left: 100, right: 104 } } };
const logger = (kpa, devices = []) => ({ vacuum: { channels: { p: { quantity: "pulsation", devices, kpa }, l: { quantity: "liner", devices, kpa } } } });
const samples = (...widths) => widths.map((width_mm) => ({ widths: [{ width_mm }] }));
/** Levels and words by name. */
const judged = (...given) => Object.fromEntries(conditionsOf(...given).map(({ name, level, word }) => [name, `${level} ${word}`]));

test("a still, empty liner without vacuum is what the reference state asks for", () => {
  assert.deepEqual(judged(DEVICE, logger(0.3), samples(25, 25.1, 25.05), 108, REFERENCE), {
    device: "good ready", measures: "good ready", targets: "good counted", wall: "good still", pulsation: "good now", liner: "good now",
  });
});

test("a vacuum, a moving wall, missing targets and a calibration that lacks are said", () => {
  const device = { ...DEVICE, lacks: [{ lacks: "calibration" }], live: { views: { left: 40, right: 104 } } };
  assert.deepEqual(judged(device, logger(42), samples(25, 22, 25), 108, REFERENCE), {
    device: "good ready", measures: "bad lacking", targets: "warn counted", wall: "warn moves", pulsation: "warn wrong_none", liner: "warn wrong_none",
  });
});

test("a milking asks for movement and a milking vacuum in the liner, whatever the pulsation chamber has", () => {
  const moving = samples(25, 22, 25);
  assert.equal(judged(DEVICE, logger(42), moving, 108, MILKING).liner, "good now");
  assert.equal(judged(DEVICE, logger(3), moving, 108, MILKING).liner, "warn wrong_milking");
  assert.equal(judged(DEVICE, logger(3), moving, 108, MILKING).pulsation, "idle now");
  assert.equal(judged(DEVICE, logger(3), samples(25, 25, 25), 108, MILKING).wall, "warn still");
});

test("what nobody knows is no warning", () => {
  const unknown = judged({ ...DEVICE, live: null }, {}, [], 0, REFERENCE);
  assert.deepEqual([unknown.targets, unknown.wall, unknown.pulsation], ["idle unknown", "idle unknown", "idle noGauge"]);
  assert.equal(judged(DEVICE, logger(0, ["another"]), [], 0, REFERENCE).liner, "idle noGauge");
  assert.equal(judged(DEVICE, logger(null), [], 0, REFERENCE).liner, "warn silent");
  for (const [state, start, said] of [["ready", "doubtful", "warn doubtful"], ["ready", "refused", "bad notReady"], ["opening", "possible", "bad notReady"]]) assert.equal(judged({ ...DEVICE, state, health: { start } }, {}, [], 0, REFERENCE).device, said);
  assert.deepEqual(judged(null, {}, [], 0, REFERENCE), { device: "bad away" });
});

test("an offer is stored if the profile says the same, in whatever sequence", () => {
  const offer = { kind: "liner", material: { E_mpa: 3, wall_mm: 2.5 }, rows: [1, 2] };
  assert.ok(isSame(offer, { rows: [1, 2], material: { wall_mm: 2.5, E_mpa: 3 }, kind: "liner" }));
  for (const other of [{ ...offer, rows: [2, 1] }, { ...offer, note: "" }, { ...offer, rows: { 0: 1, 1: 2 } }, null]) assert.ok(!isSame(offer, other));
});
