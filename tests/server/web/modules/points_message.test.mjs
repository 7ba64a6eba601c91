// The messages of the points' stream as the daemon writes them.
import assert from "node:assert/strict";
import { test } from "node:test";
import { columnsOf, readPoints } from "../../../../src/grabberd/server/web/static/js/live/points_message.js";

/** As `documents/points_frame.py` writes it: a frame of two points. */
function message({ header = 56, version = 1, magic = "GRBX" } = {}) {
  const buffer = new ArrayBuffer(header + 2 * 80);
  const view = new DataView(buffer);
  [...magic].forEach((letter, i) => view.setUint8(i, letter.charCodeAt(0)));
  view.setUint16(4, version, true);
  view.setUint16(6, header, true);
  view.setBigUint64(8, 4711n, true);
  view.setBigInt64(16, 123n, true);
  view.setBigInt64(24, 1_700_000_000_123_456n, true);
  view.setBigUint64(40, 9n, true);
  view.setUint32(48, 3, true);
  view.setUint32(52, 2, true);
  [1, 2, 3, 4, 5, 6].forEach((value, i) => view.setFloat64(header + 8 * i, value, true));
  [4, 0, 0, 9, 0, 16, 1, 0, 0, 1, 0, 1].forEach((value, i) => view.setFloat32(header + 48 + 4 * i, value, true));
  [0.5, 0.25].forEach((value, i) => view.setFloat32(header + 144 + 4 * i, value, true));
  [7, 4_000_000_000].forEach((value, i) => view.setUint32(header + 152 + 4 * i, value, true));
  return buffer;
}

test("a frame is read where the reference says", () => {
  const frame = readPoints(message());
  assert.deepEqual([frame.n, frame.sequence, frame.description, frame.time_ms], [4711, 9, 3, 1_700_000_000_123.456]);
  assert.deepEqual([...frame.target], [7, 4_000_000_000]);
  assert.deepEqual([...frame.xyz_mm], [1, 2, 3, 4, 5, 6]);
  assert.deepEqual([...frame.residual_px], [0.5, 0.25]);
});

test("a longer header moves what follows", () => {
  assert.deepEqual([...readPoints(message({ header: 64 })).xyz_mm], [1, 2, 3, 4, 5, 6]);
});

test("other messages and other versions are refused", () => {
  assert.throws(() => readPoints(message({ magic: "GRBP" })));
  assert.throws(() => readPoints(message({ version: 2 })));
});

test("its columns have the names and units of the documents", () => {
  const columns = columnsOf(readPoints(message()));
  assert.deepEqual(columns.y_mm, [2, 5]);
  assert.deepEqual([columns.sigma_x_mm[0], columns.sigma_y_mm[0], columns.sigma_z_mm[0]], [2, 3, 4]);
  assert.equal(columns.utc, "2023-11-14T22:13:20.123Z");
});
