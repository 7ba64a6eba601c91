// Which part of the picture is shown, which values its messages have, and the best focus so far.
import assert from "node:assert/strict";
import { deflateSync } from "node:zlib";
import { test } from "node:test";
import { bestOf, createTrend } from "../../../../src/grabberd/server/web/static/js/adjust/trend.js";
import { readPreview } from "../../../../src/grabberd/server/web/static/js/live/message.js";
import { MOST_ZOOM, WHOLE, partOf, shifted, zoomed } from "../../../../src/grabberd/server/web/static/js/live/view.js";

const FRAME = { columns: 720, lines: 576 };

test("what lies under the fingers stays there while it is zoomed", () => {
  const at = { x: 200, y: 100 };
  const view = zoomed(zoomed(WHOLE, 3, at, FRAME), 1.5, at, FRAME);
  assert.equal(view.zoom, 4.5);
  assert.ok(Math.abs((at.x - view.x) * view.zoom - 200) < 1e-9);
  assert.ok(Math.abs((at.y - view.y) * view.zoom - 100) < 1e-9);
});

test("the view never leaves the frame, and comes no nearer than is of use", () => {
  assert.deepEqual(shifted(WHOLE, 50, -50, FRAME), WHOLE);
  assert.deepEqual(zoomed(WHOLE, 0.5, { x: 9, y: 9 }, FRAME), WHOLE);
  const corner = zoomed(WHOLE, 2, { x: 720, y: 576 }, FRAME);
  assert.deepEqual(corner, { x: 360, y: 288, zoom: 2 });
  assert.deepEqual(shifted(corner, 99, 99, FRAME), corner);
  assert.equal(zoomed(WHOLE, 1000, { x: 0, y: 0 }, FRAME).zoom, MOST_ZOOM);
});

test("the daemon is asked for what is shown, in whole blocks, and for all of it only if all is shown", () => {
  assert.equal(partOf(WHOLE, FRAME), null);
  assert.deepEqual(partOf({ x: 101, y: 50, zoom: 4 }, FRAME), { x: 96, y: 48, columns: 192, lines: 152 });
  assert.deepEqual(partOf({ x: 539, y: 431, zoom: 4 }, FRAME), { x: 536, y: 424, columns: 184, lines: 152 });
});

function message(pixels, columns, encoding) {
  const deflated = deflateSync(Uint8Array.from(pixels));
  const view = new DataView(new ArrayBuffer(76 + 8 + deflated.length + 24));
  view.setUint32(0, 0x50425247, true);
  view.setUint16(6, 76, true);
  view.setBigInt64(16, 5_000_000n, true);
  for (const [at, value] of [[32, columns], [34, 2], [36, 41], [38, 2], [56, 80], [58, 1], [60, 720], [62, 576]]) view.setUint16(at, value, true);
  for (const [at, value] of [[44, 1], [48, deflated.length], [52, 1], [68, 7], [72, 9], [76 + 8 + deflated.length, 108]]) view.setUint32(at, value, true);
  view.setUint8(64, encoding);
  view.setFloat32(76, 12.5, true);
  new Uint8Array(view.buffer).set(deflated, 84);
  return view.buffer;
}

test("a grey picture is the sum of its differences, row by row, and has its place in the frame", async () => {
  const found = await readPreview(message([100, 5, 255, 10, 0, 245], 3, 1));
  assert.deepEqual([...found.pixels], [100, 105, 104, 10, 10, 255]);
  assert.deepEqual([found.isGrey, found.x0, found.y0, found.yStep, found.frame], [true, 80, 41, 2, FRAME]);
  assert.deepEqual([found.white, found.black, found.centroids[0], found.points[0].target, found.time_ms], [7, 9, 12.5, 108, 5000]);
});

test("bits stay as they are", async () => {
  const found = await readPreview(message([0b10000000, 0b11], 8, 0));
  assert.deepEqual([found.isGrey, [...found.pixels]], [false, [128, 3]]);
});

test("the best focus of a view is the greatest of the last minutes, and starts again when it is asked to", () => {
  const trend = createTrend(120);
  for (const [time_s, left] of [[0, 0.95], [100, 0.92], [130, null], [141, 0.71]]) trend.add({ time_s, left, right: null });
  assert.deepEqual(bestOf(trend.samples(), "left"), { value: 0.92, time_s: 100 });
  assert.equal(bestOf(trend.samples(), "right"), null);
  trend.clear();
  assert.equal(bestOf(trend.samples(), "left"), null);
});
