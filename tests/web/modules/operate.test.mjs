// From what was filled in before Start to the capture that is requested.
import assert from "node:assert/strict";
import { test } from "node:test";
import { requestOf, USUAL, wishFrom } from "../../../src/grabberd/web/static/js/operate/wish.js";

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
