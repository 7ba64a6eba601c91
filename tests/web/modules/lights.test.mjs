// The light of captures and settings: what is wrong with the daemon itself.
import assert from "node:assert/strict";
import test from "node:test";
import { judge } from "../../../src/grabberd/web/static/js/lights/judge.js";

const FAULT = { cause_code: "settings_lost", level: "fault", message: "lost", hint: "restore", since_utc: "2026-03-01T09:30:00.000Z" };
const DEVICE = {
  name: "cup", state: "ready", signal: "present", rate_hz: 50, stream: { rate_hz: 50 }, ring: { waiting: 0, slots: 32 },
  fields: {}, lacks: [], calibration: { id: "rig", age_days: 1 }, rig: null, cause: null, hint: null, cause_code: null,
  computer: { cause: null, hint: null, cause_code: null, since_utc: null },
};
const NO_LOSSES = { enter() {}, losses: () => ({ lost: 0, all: 0 }) };

function light(faults, storage = {}) {
  const state = { devices: { cup: DEVICE }, faults, storage: { minutes_left: 100, cause_code: null, problem: null, ...storage } };
  const known = { state, device: "cup", connection: { online: true }, clockOffset_ms: 0 };
  return judge(known, NO_LOSSES).find((one) => one.id === "records");
}

test("a daemon without faults is in order", () => {
  assert.deepEqual(light([]), { id: "records", level: "good", word: "good" });
});

test("what a person has to act on is bad, with its code, its moment and the daemon's words", () => {
  const { level, word, code, since, said } = light([FAULT]);
  assert.deepEqual([level, word, code, since, said], ["bad", "fault", "settings_lost", FAULT.since_utc, ["lost", "restore"]]);
});

test("what repairs itself is a warning", () => {
  assert.equal(light([{ ...FAULT, level: "warning", cause_code: "index_rebuilding" }]).level, "warn");
});

test("a folder that is gone is told by the light of the disk alone", () => {
  const gone = { ...FAULT, cause_code: "captures_missing" };
  const disk = { cause_code: "captures_missing", minutes_left: null, problem: "gone" };
  assert.equal(light([gone], disk).level, "good");
  assert.equal(light([gone, FAULT], disk).code, "settings_lost");
});

function order(field_order) {
  const state = { devices: { cup: { ...DEVICE, field_order } }, faults: [], storage: { minutes_left: 100, cause_code: null, problem: null } };
  const known = { state, device: "cup", connection: { online: true }, clockOffset_ms: 0 };
  return judge(known, NO_LOSSES).find((one) => one.id === "order");
}

test("fields in the wrong sequence are bad, with reasons and remedies", () => {
  for (const wrong of ["reversed", "same_instant"]) assert.deepEqual(order({ order: wrong }), { id: "order", level: "bad", word: wrong, cause: wrong });
});

test("what an object at rest does not tell is not known yet", () => {
  assert.equal(order({ order: "right" }).level, "good");
  assert.equal(order({ order: "no_movement" }).level, "idle");
  assert.equal(order(null).word, "unknown");
});
