// The lights and the big state, from the health that the daemon makes.
import assert from "node:assert/strict";
import test from "node:test";
import { IDS, judge } from "../../../../src/grabberd/server/web/static/js/lights/judge.js";
import { situationOf } from "../../../../src/grabberd/server/web/static/js/operate/situation.js";

const GOOD = { level: "good", word: "good", message: "", hint: "", cause_code: null, since_utc: null };
const LOST = { ...GOOD, level: "bad", word: "some", message: "400 of 500 fields were lost or damaged", hint: "close other programs" };

function known(parts = {}, changes = {}, rest = {}) {
  const worst = Object.keys(parts)[0] ?? null;
  const health = { level: worst ? parts[worst].level : "good", part: worst, start: worst ? "doubtful" : "allowed", parts: { ...Object.fromEntries(IDS.map((id) => [id, GOOD])), ...parts } };
  const device = {
    name: "cup", state: "ready", since_utc: "2026-03-01T09:30:00.000Z", rate_hz: 50, stream: { rate_hz: 50 }, ring: { waiting: 0, slots: 32 },
    last_minute: { due: 500, lost: 0 }, calibration: { id: "rig", age_days: 1 }, live: { points: 72 }, health, ...changes,
  };
  const state = { devices: { cup: device }, faults: [], storage: { minutes_left: 100 } };
  return { state, device: "cup", connection: { online: true, since: 0 }, clockOffset_ms: 0, ...rest };
}

const light = (id, ...of) => judge(known(...of)).find((one) => one.id === id);

test("every light is what the daemon says of it", () => {
  assert.deepEqual(judge(known()).map(({ id, level }) => [id, level]), IDS.map((id) => [id, "good"]));
  const lost = light("lost", { lost: LOST }, { last_minute: { due: 500, lost: 400 } });
  assert.deepEqual([lost.level, lost.word, lost.values, lost.said], ["bad", "some", { n: 400 }, [LOST.message, LOST.hint]]);
});

test("what the daemon does not know is not called good", () => {
  assert.equal(light("rig", { rig: { ...GOOD, level: "unknown", word: "unknown" } }).level, "idle");
});

test("what does not apply to a device has no light", () => {
  const progressive = known();
  delete progressive.state.devices.cup.health.parts.order;
  assert.deepEqual(judge(progressive).map(({ id }) => id), IDS.filter((id) => id !== "order"));
});

test("without the daemon nothing is known", () => {
  const lights = judge(known({}, {}, { connection: { online: false, since: 0 } }));
  assert.deepEqual(new Set(lights.map((one) => one.level)), new Set(["idle"]));
});

test("a clock that differs from this tablet's is told, unless the daemon's was never set", () => {
  assert.equal(judge(known({}, {}, { clockOffset_ms: 60_000 })).find((one) => one.id === "clock").word, "ahead");
  const unset = known({ clock: { ...GOOD, level: "warning", word: "unset" } }, {}, { clockOffset_ms: -60_000 });
  assert.equal(judge(unset).find((one) => one.id === "clock").word, "unset");
});

test("a grabber that is ready but loses most fields is not shown as ready, and Start is doubtful", () => {
  const { word, level, why, doubtful, worst } = situationOf(known({ lost: LOST }), true);
  assert.deepEqual([word, level, why, doubtful, worst.id], ["troubled", "bad", null, true, "lost"]);
});

test("a warning colours the state and leaves its word", () => {
  const { word, level } = situationOf(known({ lost: { ...LOST, level: "warning" } }), true);
  assert.deepEqual([word, level], ["ready", "warn"]);
});

test("a capture that runs is shown as one, in the colour of what is wrong", () => {
  const running = { state: "capturing", capture_id: "c" };
  assert.deepEqual([situationOf(known({ lost: LOST }, running), true).word, situationOf(known({ lost: LOST }, running), true).level], ["capturing", "bad"]);
  assert.equal(situationOf(known({ lost: { ...LOST, level: "warning" } }, running), true).level, "busy");
});

test("a disk that cannot be read keeps Start from being offered", () => {
  const full = known({ disk: { ...GOOD, level: "bad", word: "broken" } });
  full.state.storage.minutes_left = null;
  full.state.devices.cup.health.start = "refused";
  assert.equal(situationOf(full, true).why, "broken");
});
