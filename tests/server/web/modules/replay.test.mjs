// A replay: its messages, its playhead, its cycles, what it fetches and forgets, and its film.
import assert from "node:assert/strict";
import { test } from "node:test";
import { ledgerIn, lengthIn, periodOf } from "../../../../src/grabberd/server/web/static/js/captures/words.js";
import { ApiProblem } from "../../../../src/grabberd/server/web/static/js/core/api.js";
import { cycleAt, startsByCurve, startsByPhase } from "../../../../src/grabberd/server/web/static/js/replay/cycles.js";
import { readPictureStretch, readPointStretch } from "../../../../src/grabberd/server/web/static/js/replay/messages.js";
import { advanced } from "../../../../src/grabberd/server/web/static/js/replay/playhead.js";
import { createStretches } from "../../../../src/grabberd/server/web/static/js/replay/stretches.js";
import { recordedVacuum, windowOf } from "../../../../src/grabberd/server/web/static/js/replay/vacuum.js";
import { createWebm, keyFrameOf } from "../../../../src/grabberd/server/web/static/js/replay/webm.js";
import { facingOf, widthOf } from "../../../../src/grabberd/server/web/static/js/replay/widths.js";

/** As `archive/export/page_documents.py` writes it: fields 100 and 102, with two targets and one. */
function pointMessage({ magic = "GRRP", version = 1 } = {}) {
  const buffer = new ArrayBuffer(32 + 2 * 16 + 3 * 40);
  const view = new DataView(buffer);
  [...magic].forEach((letter, i) => view.setUint8(i, letter.charCodeAt(0)));
  view.setUint16(4, version, true);
  view.setUint16(6, 32, true);
  view.setBigUint64(8, 100n, true);
  view.setUint32(16, 2, true);
  view.setUint32(20, 3, true);
  [2, 2.04].forEach((value, i) => view.setFloat64(32 + 8 * i, value, true));
  [0, 2, 2, 1, 7, 8, 7].forEach((value, i) => view.setUint32(48 + 4 * i, value, true));
  Array.from({ length: 27 }, (_, i) => view.setFloat32(76 + 4 * i, i, true));
  return buffer;
}

test("a stretch of points is read field by field", () => {
  const fields = readPointStretch(pointMessage());
  assert.deepEqual([...fields.keys()], [100, 102]);
  const [one, other] = fields.values();
  assert.deepEqual([one.n, one.time_s, [...one.target], [...one.xyz_mm]], [100, 2, [7, 8], [0, 1, 2, 3, 4, 5]]);
  assert.deepEqual([[...other.target], [...other.xyz_mm], [...other.sigma_mm], [...other.residual_px]], [[7], [6, 7, 8], [11], [14]]);
  assert.deepEqual([...other.image_px], [23, 24, 25, 26]);
});

test("other messages are refused", () => {
  assert.throws(() => readPointStretch(pointMessage({ magic: "GRBX" })));
  assert.throws(() => readPointStretch(pointMessage({ version: 2 })));
  assert.throws(() => readPictureStretch(pointMessage()));
  assert.throws(() => readPointStretch(new ArrayBuffer(3)));
});

test("a stretch of pictures has each with its place and its outcome", async () => {
  const buffer = new ArrayBuffer(24 + 2 * 16 + 5);
  const view = new DataView(buffer);
  [..."GRRF"].forEach((letter, i) => view.setUint8(i, letter.charCodeAt(0)));
  view.setUint16(4, 1, true);
  view.setUint16(6, 24, true);
  view.setBigUint64(8, 50n, true);
  view.setUint32(16, 2, true);
  for (const [i, [n, length, y0, step, outcome]] of [[1, 2, 0, 2, 0], [3, 3, 1, 2, 1]].entries()) {
    view.setUint32(24 + 16 * i, n, true);
    view.setUint32(28 + 16 * i, length, true);
    view.setUint16(32 + 16 * i, y0, true);
    view.setUint16(34 + 16 * i, step, true);
    view.setUint8(36 + 16 * i, outcome);
  }
  new Uint8Array(buffer, 56).set([1, 2, 3, 4, 5]);
  const [one, other] = readPictureStretch(buffer).values();
  assert.deepEqual([one.n, one.y0, one.yStep, one.outcome, other.n, other.y0, other.outcome], [51, 0, 2, "received", 53, 1, "damaged"]);
  assert.deepEqual([...new Uint8Array(await other.png.arrayBuffer())], [3, 4, 5]);
});

test("the playhead goes at its speed and begins again at the end of its range", () => {
  assert.equal(advanced(10, 1, 1, [0, 100], 0.02), 60);
  assert.equal(advanced(10, 1, 0.1, [0, 100], 0.02), 15);
  assert.equal(advanced(90, 1, 1, [0, 100], 0.02), 40);
  assert.equal(advanced(90, 0.3, 1, [80, 95], 0.02), 90);
  assert.equal(advanced(10, 0, 1, [50, 100], 0.02), 50);
});

test("the playhead goes at the rate of its capture", () => {
  for (const rate of [25, 60, 100, 120]) assert.ok(Math.abs(advanced(0, 0.5, 1, [0, 1000], 1 / rate) - rate / 2) < 1e-9);
});

test("a ledger counts seconds at the rate of its capture", () => {
  const t = (key, values) => `${key} ${JSON.stringify(values ?? {})}`;
  const context = { t, tn: (key, n, values) => t(key, { n, ...values }), format: { number: (value, digits) => value.toFixed(digits), duration: String } };
  const entries = [{ first_n: 240, count: 3, outcome: "lost", reason: "time gap" }];
  const capture = (rate_hz) => ({ rate_hz, ledger: { complete: false, entries, events: [], counts: { received: 597, lost: 3 } } });
  assert.match(lengthIn(context, capture(120)), /"s":"5.0"/);
  assert.match(lengthIn(context, capture(50)), /"s":"12.0"/);
  assert.match(ledgerIn(context, capture(120)), /"at":"2.0"/);
  assert.equal(periodOf(capture(null)), 0);
});

test("cycles are those of the analysis, or of the curve itself", () => {
  const phases = new Map(Array.from({ length: 120 }, (_, n) => [n, ((n + 10) % 50) / 50]));
  assert.deepEqual(startsByPhase(phases), [40, 90]);
  const curve = Array.from({ length: 200 }, (_, n) => [n, 20 + 3 * Math.sin((2 * Math.PI * n) / 50)]);
  const starts = startsByCurve(curve);
  assert.deepEqual(starts.slice(1).map((n, i) => n - starts[i]), [50, 50]);
  assert.deepEqual(cycleAt([40, 90, 140], 95, 0.02), [90, 140]);
  assert.deepEqual(cycleAt([40, 90, 140], 3, 0.02), [40, 90]);
  assert.equal(cycleAt([40], 3, 0.02), null);
});

test("a wall that stands still has no cycle, however noisy", () => {
  assert.deepEqual(startsByCurve(Array.from({ length: 200 }, (_, n) => [n, 20 + 0.1 * ((n * 7919) % 3)])), []);
  assert.deepEqual(startsByCurve([]), []);
});

/** A source that answers when it is told to. */
function slowSource(options = {}) {
  /** @type {{first: number, count: number, signal: AbortSignal, answer: (fields?: unknown) => void, fail: (problem: unknown) => void}[]} */
  const asked = [];
  const load = (first, count, signal) => new Promise((resolve, reject) => {
    const whole = () => new Map(Array.from({ length: count }, (_, i) => [first + i, first + i]));
    asked.push({ first, count, signal, answer: (fields = whole()) => resolve(fields), fail: reject });
  });
  const stretches = createStretches({ length: 10, ahead: 2, kept: 4, total: () => 1000, load, changed: () => {}, ...options });
  return { asked, stretches };
}
const settle = () => new Promise((resolve) => setImmediate(resolve));

test("the stretch of the playhead is fetched first, two at a time, and then those ahead", async () => {
  const { asked, stretches } = slowSource();
  stretches.want(15);
  assert.deepEqual(asked.map((one) => [one.first, one.count]), [[10, 10], [20, 10]]);
  assert.equal(stretches.settled(15), false);
  asked[0].answer();
  await settle();
  assert.deepEqual([stretches.settled(15), stretches.at(15), stretches.at(25)], [true, 15, undefined]);
  assert.equal(asked[2].first, 30);
  stretches.end();
});

test("what is no longer needed after a seek is given up", async () => {
  const { asked, stretches } = slowSource();
  stretches.want(15);
  stretches.want(505);
  assert.deepEqual(asked.map((one) => one.signal.aborted), [true, true, false, false]);
  assert.equal(asked[2].first, 500);
  stretches.end();
});

test("a long capture takes no more memory than a short one", async () => {
  const { asked, stretches } = slowSource();
  for (let n = 0; n < 900; n += 10) {
    stretches.want(n);
    for (let i = 0; i < 3; i += 1) {
      for (const one of asked.splice(0)) one.answer();
      await settle();
    }
  }
  assert.ok(stretches.held() <= 4);
  assert.equal(stretches.at(895), 895);
  stretches.end();
});

test("a field that is lost is settled without being there", async () => {
  const { asked, stretches } = slowSource();
  stretches.want(0);
  asked[0].answer(new Map([[0, 0]]));
  await settle();
  assert.deepEqual([stretches.settled(5), stretches.at(5), stretches.problemAt(5)], [true, undefined, null]);
  stretches.end();
});

test("a stretch that cannot be read says why, and does not hold up the others", async () => {
  const { asked, stretches } = slowSource();
  stretches.want(0);
  asked[0].fail(new ApiProblem(410, { detail: "damaged" }));
  asked[1].answer();
  await settle();
  assert.deepEqual([stretches.settled(5), stretches.problemAt(5).detail, stretches.at(12)], [true, "damaged", 12]);
  stretches.want(0);
  assert.ok(!asked.slice(3).some((one) => one.first === 0));
  stretches.end();
});

test("a capture that grows is asked for its newest stretch again", async () => {
  let total = 14;
  const { asked, stretches } = slowSource({ total: () => total });
  stretches.want(12);
  assert.deepEqual([asked[0].first, asked[0].count], [10, 4]);
  asked[0].answer();
  await settle();
  total = 18;
  stretches.want(16);
  assert.deepEqual([asked[1].first, asked[1].count, stretches.settled(16), stretches.at(12)], [10, 8, false, 12]);
  stretches.end();
});

test("who waits for a field is told when it is settled, and when all ends", async () => {
  const { asked, stretches } = slowSource();
  const one = stretches.ensure(5);
  asked[0].answer();
  assert.equal(await one, true);
  const other = stretches.ensure(700);
  stretches.end();
  assert.equal(await other, false);
});

test("channels lie on one time axis", () => {
  const vacuum = recordedVacuum([{ name: "liner", time_s: [0, 1, 2], kpa: [40, 41, 42] }, { name: "pulsation", time_s: [0, 0.5, 1, 1.5], kpa: [0, 10, 20, 30] }]);
  assert.deepEqual(vacuum.time_s, [0, 0.5, 1, 1.5]);
  assert.deepEqual(vacuum.kpa, [[null, 40.5, 41, 41.5], [0, 10, 20, 30]]);
  assert.deepEqual(windowOf(vacuum, 0.5, 1.5), [[0.5, 1], [40.5, 41], [10, 20]]);
  assert.equal(recordedVacuum([{ name: "light", time_s: [0], kpa: [] }]), null);
});

/** @param {string} kind of its chunk */
const webp = (kind) => new Uint8Array([...new TextEncoder().encode("RIFF"), 30, 0, 0, 0, ...new TextEncoder().encode(`WEBP${kind}`), 3, 0, 0, 0, 9, 8, 7, 0]);

test("a film has every picture at its time", async () => {
  const webm = createWebm({ width: 64, height: 48, frame_ms: 80, title: "one" });
  for (let i = 0; i < 3; i += 1) await webm.add(new Blob([webp("VP8 ")]));
  const bytes = new Uint8Array(await webm.film().arrayBuffer());
  const blocks = bytes.reduce((found, byte, i) => (byte === 0xa3 && bytes[i + 9] === 0x81 && bytes[i + 12] === 0x80 ? [...found, 256 * bytes[i + 10] + bytes[i + 11]] : found), []);
  assert.deepEqual(blocks, [0, 80, 160]);
});

test("a browser that makes other pictures is told from one that makes lossy WebP", () => {
  assert.deepEqual([...keyFrameOf(webp("VP8 "))], [9, 8, 7]);
  assert.throws(() => keyFrameOf(webp("VP8L")), /lossy/);
  assert.throws(() => keyFrameOf(new Uint8Array([0x89, 0x50, 0x4e, 0x47])), /WebP/);
});

test("the width is that between the outermost targets of the middle row that are seen nearly as often as any", () => {
  const grid = { target: [1, 2, 3, 4, 5, 6, 7, 8], row: [0, 1, 1, 1, 1, 1, 1, 2], column: [0, 0, 1, 2, 3, 4, 5, 0] };
  const pairs = facingOf(grid);
  assert.deepEqual(pairs, [[2, 7], [3, 6], [4, 5]]);
  const field = (n, target) => ({ n, target, x_mm: target, y_mm: target.map(() => 0), z_mm: target.map(() => 0) });
  const fields = Array.from({ length: 10 }, (_, n) => field(n, n < 8 ? [2, 3, 6, 7] : [3, 6]));
  assert.deepEqual([...widthOf(fields, pairs).values()], Array(10).fill(3));
  assert.equal(widthOf([field(0, [8])], pairs).size, 0);
});
