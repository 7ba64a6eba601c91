// From what was filled in before Start to the capture that is requested.
import assert from "node:assert/strict";
import { test } from "node:test";
import { progressOf } from "../../../../src/grabberd/server/web/static/js/operate/progress.js";
import { situationOf } from "../../../../src/grabberd/server/web/static/js/operate/situation.js";
import { namesSubject, nextOf, requestOf, USUAL, wishFrom } from "../../../../src/grabberd/server/web/static/js/operate/wish.js";

test("a wish that was kept is taken over", () => {
  const kept = { ...USUAL, kind: "cycles", cycles: 30, ownPerMinute: 61.5, labels: { cow: "417" } };
  assert.deepEqual(wishFrom(kept), kept);
});

test("what was kept in another form than today's is left out, and so is what is unknown", () => {
  assert.deepEqual(wishFrom({ kind: "hours", seconds: "10", wait: 1, labels: null, liner: "new", before: 25 }), { before: 25 });
  for (const nothing of [null, "wish", 7]) assert.deepEqual(wishFrom(nothing), {});
});

test("the fields before the start count among those of the capture", () => {
  const request = requestOf({ ...USUAL, seconds: 2, before: 10, note: " slipped " }, { device: "barn" }, 50);
  assert.deepEqual(request, { device: "barn", pre_trigger_fields: 10, labels: {}, note: "slipped", fields: 110 });
});

test("an armed capture counts its fields from the trigger", () => {
  const request = requestOf({ ...USUAL, kind: "stop", wait: true }, { devices: "all" }, 50);
  assert.deepEqual(request, { devices: "all", pre_trigger_fields: 0, labels: {}, note: "", armed: true, post_trigger_fields: null });
});

test("the next cow takes the liner along, and neither number, teat nor note", () => {
  const wish = { ...USUAL, labels: { cow: "112", teat: "front left", liner: "A", name: "morning" }, note: "kicked", of: "c1" };
  assert.equal(namesSubject(wish), true);
  assert.deepEqual(nextOf(wish), { labels: { liner: "A", name: "morning" }, note: "", of: "" });
  assert.equal(namesSubject({ ...wish, ...nextOf(wish) }), false);
});

test("a capture of a length has a share and a time left, one until stopped has neither", () => {
  const capture = { trigger_utc: "2026-03-01T09:30:00.000Z", created_utc: "2026-03-01T09:29:59.000Z", pre_trigger_fields: 25, length_fields: 500 };
  const at_ms = Date.parse("2026-03-01T09:30:02.000Z");
  assert.deepEqual(progressOf(capture, at_ms, 50), { done_s: 2.5, left_s: 7.5, share: 0.25 });
  assert.deepEqual(progressOf({ ...capture, length_fields: null }, at_ms, 50), { done_s: 2.5, left_s: null, share: null });
});

test("a capture is never more than whole, nor less than begun", () => {
  const capture = { trigger_utc: null, created_utc: "2026-03-01T09:30:00.000Z", pre_trigger_fields: 0, length_fields: 50 };
  assert.equal(progressOf(capture, Date.parse("2026-03-01T09:31:00.000Z"), 50).share, 1);
  assert.equal(progressOf(capture, Date.parse("2026-03-01T09:29:00.000Z"), 50).done_s, 0);
});

test("while the last capture is being stored, Start says so in place of a refusal", () => {
  const device = { name: "barn", state: "ready", capture_id: null, armed_capture_id: null, sealing_capture_id: null, health: { start: "allowed", parts: {} } };
  const known = (/** @type {object} */ changes) => ({ connection: { online: true, since: 0 }, device: null, state: { devices: { barn: { ...device, ...changes } }, faults: [], storage: {} } });
  assert.equal(situationOf(known({}), true).why, null);
  assert.equal(situationOf(known({ sealing_capture_id: "c1" }), true).why, "sealing");
  assert.equal(situationOf(known({ sealing_capture_id: "c1", state: "absent" }), true).why, "absent");
});
