// The wall and the vacuum of the last seconds, joined from messages that overlap.
import assert from "node:assert/strict";
import { test } from "node:test";
import { loggersOf, readCurves } from "../../../../src/grabberd/server/web/static/js/live/curves_message.js";

const each = (fields, value) => fields.map(() => value);
const message = (now_s, fields, steps) => ({
  device: "left", now_s, now_utc_s: 1000 + now_s, time_s: fields, points: each(fields, 70), residual_px: each(fields, null), latency_ms: each(fields, 2),
  targets: { left: each(fields, 80), right: each(fields, 81) }, widths: [{ targets: [1, 6], width_mm: fields.map((_, i) => 20 + i), sigma_mm: each(fields, 0.1) }],
  channels: [{ name: "pulsation", quantity: "pulsation", logger: "tank", time_s: steps, kpa: steps.map((_, i) => 40 + i) }],
});

const read = (before, next) => readCurves(before, next, 10);

test("messages that overlap add what is new, and correct the step that was not over", () => {
  const first = read(null, message(1, [0.96, 0.98], [0.97, 0.99]));
  const both = read(first, message(1.2, [0.98, 1, 1.02], [0.99, 1.01]));
  assert.deepEqual(both.fields.map((one) => one.time_s), [0.96, 0.98, 1, 1.02]);
  assert.deepEqual(both.readings.map((one) => [one.time_s, one.kpa.pulsation]), [[0.97, 40], [0.99, 40], [1.01, 41]]);
});

test("what is older than ten seconds is forgotten", () => {
  const old = read(null, message(1, [0.98], [0.99]));
  const now = read(old, message(11.5, [11.4], [11.41]));
  assert.deepEqual([now.fields.length, now.readings.length], [1, 1]);
});

test("a computer that was started anew begins anew", () => {
  const before = read(null, message(5000, [4999.9], [4999.9]));
  assert.deepEqual(read(before, message(3, [2.9], [])).fields.map((one) => one.time_s), [2.9]);
});

test("a field has its numbers, and what the daemon does not know is missing, not nought", () => {
  const { fields: [one], epoch_s } = read(null, { ...message(5, [4.9], []), targets: {} });
  assert.deepEqual(one, { time_s: 4.9, left: null, right: null, points: 70, residual_px: null, latency_ms: 2, widths: [{ width_mm: 20, sigma_mm: 0.1 }] });
  assert.equal(epoch_s + one.time_s, 1004.9);
});

test("channels are told apart, and one that says nothing leaves a gap", () => {
  const two = message(1, [], [0.97, 0.99]);
  two.channels.push({ name: "liner", time_s: [0.99], kpa: [42] });
  assert.deepEqual(read(null, two).readings, [{ time_s: 0.97, kpa: { pulsation: 40 } }, { time_s: 0.99, kpa: { pulsation: 41, liner: 42 } }]);
});

const logger = (name, state, channels, cause = null) => ({ name, state, cause, channels });
const of = (...devices) => ({ quantity: "pulsation", devices });

test("a device has the loggers whose channels are its own or everybody's", () => {
  const state = { loggers: {
    tank: logger("tank", "ready", { liner: of() }),
    hose: logger("hose", "ready", { pulsation: of("right") }),
  } };
  assert.deepEqual(loggersOf(state, "left"), [{ name: "tank", channels: ["liner"], cause: null }]);
  assert.deepEqual(loggersOf(null, "left"), []);
});

test("a logger that gives nothing says why, and one that is being opened is no fault", () => {
  const state = { loggers: {
    a: logger("a", "absent", { liner: of() }, "there is no /dev/ttyUSB0"),
    b: logger("b", "opening", { pulsation: of() }),
  } };
  assert.deepEqual(loggersOf(state, "left").map((one) => one.cause), ["there is no /dev/ttyUSB0", null]);
});
