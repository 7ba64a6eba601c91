// The preview's binary messages: docs/reference/live.md byte for byte.

const MAGIC = 0x50425247; // "GRBP", little endian
const OUTCOMES = ["received", "damaged", "no_signal"];
const POINT_BYTES = 24;

/**
 * @typedef {object} Preview
 * @property {number} n the field's number
 * @property {number} time_ms middle of its exposure, since 1970, by the daemon's clock
 * @property {number} columns
 * @property {number} rows 0 where there is no picture
 * @property {number} y0
 * @property {number} yStep
 * @property {number} threshold
 * @property {string} outcome
 * @property {Float32Array} centroids x, y of every blob, frame pixels
 * @property {Point[]} points
 * @property {Uint8Array} bits packed rows
 *
 * @typedef {{target: number, image: number[], residual: number}} Point image: x, y in the left view and in the right one
 */

/** @param {ArrayBuffer} buffer @returns {Promise<Preview>} */
export async function readPreview(buffer) {
  const view = new DataView(buffer);
  if (view.getUint32(0, true) !== MAGIC) throw new Error("no preview message");
  const header = view.getUint16(6, true);
  const count = view.getUint32(44, true);
  const deflated = view.getUint32(48, true);
  const bitsAt = header + 8 * count;
  const points = header >= 56 ? view.getUint32(52, true) : 0;
  return {
    n: Number(view.getBigUint64(8, true)),
    time_ms: Number(view.getBigInt64(16, true)) / 1000,
    columns: view.getUint16(32, true),
    rows: view.getUint16(34, true),
    y0: view.getUint16(36, true),
    yStep: view.getUint16(38, true),
    threshold: view.getUint16(40, true),
    outcome: OUTCOMES[view.getUint8(42)] ?? "received",
    centroids: new Float32Array(buffer.slice(header, bitsAt)),
    points: Array.from({ length: points }, (_, i) => readPoint(view, bitsAt + deflated + i * POINT_BYTES)),
    bits: deflated ? await inflate(buffer.slice(bitsAt, bitsAt + deflated)) : new Uint8Array(0),
  };
}

/** @param {DataView} view @param {number} at @returns {Point} */
function readPoint(view, at) {
  const image = [4, 8, 12, 16].map((offset) => view.getFloat32(at + offset, true));
  return { target: view.getUint32(at, true), image, residual: view.getFloat32(at + 20, true) };
}

/** @param {ArrayBuffer} deflated */
async function inflate(deflated) {
  const stream = new Blob([deflated]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}
