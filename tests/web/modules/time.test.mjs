// What is kept of the last minutes, how it becomes lines with gaps, and how moments are played.
import assert from "node:assert/strict";
import { test } from "node:test";
import { createHistory, sampleOf } from "../../../src/grabberd/web/static/js/core/history.js";
import { createRing } from "../../../src/grabberd/web/static/js/core/ring.js";
import { createStore } from "../../../src/grabberd/web/static/js/core/store.js";
import { pairOf } from "../../../src/grabberd/web/static/js/plots/facing_pair.js";
import { columnsOf, csvOf, summaryOf } from "../../../src/grabberd/web/static/js/plots/series.js";
import { advanced, indexAt, lengthOf } from "../../../src/grabberd/web/static/js/scene/playback.js";

const times = (ring, last_s) => ring.all(last_s).map((sample) => sample.time_s);

test("a ring keeps so many seconds and no more", () => {
  const ring = createRing(10);
  for (let time_s = 0; time_s < 1000; time_s += 1) ring.push({ time_s });
  assert.deepEqual(times(ring), [989, 990, 991, 992, 993, 994, 995, 996, 997, 998, 999]);
  assert.deepEqual(times(ring, 2), [997, 998, 999]);
});

test("what is no later than the last is passed over", () => {
  const ring = createRing(10);
  for (const time_s of [1, 2, 2, 1, 3]) ring.push({ time_s });
  assert.deepEqual(times(ring), [1, 2, 3]);
  assert.deepEqual(createRing(5).all(), []);
});

test("history follows the events of every device, and counts none twice", () => {
  let now_ms = 0;
  const store = createStore({ session: null, state: null, connection: { online: true, since: 0 }, device: null, clockOffset_ms: 0 });
  const history = createHistory(store, () => (now_ms += 1000));
  let told = 0;
  history.watch(() => (told += 1));
  const live = { points: 70, views: { left: 80, right: 81 }, residual_px: 0.1, latency_ms: { p50: 3, p99: 9 }, widths: [] };
  store.set({ state: { devices: { barn: { live } } } });
  store.set({ state: { devices: { barn: { live } } } });
  store.set({ state: { devices: { barn: { live: { ...live, points: 71 } } } } });
  assert.deepEqual(history.samples("barn", 60).map((sample) => sample.points), [70, 71]);
  assert.equal(told, 2);
  assert.deepEqual(history.samples("other", 60), []);
});

test("what the daemon does not say is missing, not nought", () => {
  const sample = sampleOf({ points: 0, residual_px: null, latency_ms: null, views: null }, 5);
  assert.deepEqual([sample.left, sample.residual_px, sample.p99_ms, sample.points], [null, null, null, 0]);
});

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

test("playing goes on by the time that has passed, and begins again at the end", () => {
  const playing = { at: 0, playing: true, speed: 0.5 };
  assert.equal(advanced(playing, 1, 10).at, 0.5);
  assert.equal(advanced({ ...playing, at: 9.8 }, 1, 10).at.toFixed(3), "0.300");
  assert.equal(advanced({ ...playing, playing: false }, 1, 10).at, 0);
  assert.equal(advanced(playing, 1, 0).at, 0);
});

test("the moment shown is the last one not after the time", () => {
  const times_s = [0, 0.02, 0.04, 0.1];
  assert.deepEqual([0, 0.019, 0.02, 0.09, 5, -1].map((at) => indexAt(times_s, at)), [0, 0, 1, 2, 3, 0]);
  assert.equal(lengthOf([0, 1, 2]), 3);
  assert.equal(lengthOf([4]), 0);
});
