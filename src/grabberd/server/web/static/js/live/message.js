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
 * @property {number} x0 first frame column of its first column
 * @property {number} xStep frame columns of each of its columns
 * @property {number} y0 frame line of the middle of its first row
 * @property {number} yStep frame lines from row to row
 * @property {{columns: number, lines: number}} frame
 * @property {number} threshold
 * @property {string} outcome
 * @property {Float32Array} centroids x, y of every blob, frame pixels
 * @property {Point[]} points
 * @property {boolean} isGrey
 * @property {number} white pixels of the field that are as bright as the camera gets
 * @property {number} black and as dark
 * @property {Uint8Array} pixels grey values, or rows of packed bits
 *
 * @typedef {{target: number, image: number[], residual: number}} Point image: x, y in the left view and in the right one
 */

const GREY = 1;

/** @param {ArrayBuffer} buffer @returns {Promise<Preview>} */
export async function readPreview(buffer) {
  const view = new DataView(buffer);
  if (view.getUint32(0, true) !== MAGIC) throw new Error("no preview message");
  const header = view.getUint16(6, true);
  const count = view.getUint32(44, true);
  const deflated = view.getUint32(48, true);
  const at = header + 8 * count;
  const points = view.getUint32(52, true);
  const columns = view.getUint16(32, true);
  const isGrey = view.getUint8(64) === GREY;
  const pixels = deflated ? await inflate(buffer.slice(at, at + deflated)) : new Uint8Array(0);
  return {
    n: Number(view.getBigUint64(8, true)),
    time_ms: Number(view.getBigInt64(16, true)) / 1000,
    columns,
    rows: view.getUint16(34, true),
    x0: view.getUint16(56, true),
    xStep: view.getUint16(58, true),
    y0: view.getUint16(36, true),
    yStep: view.getUint16(38, true),
    frame: { columns: view.getUint16(60, true), lines: view.getUint16(62, true) },
    threshold: view.getUint16(40, true),
    outcome: OUTCOMES[view.getUint8(42)] ?? "received",
    centroids: new Float32Array(buffer.slice(header, at)),
    points: Array.from({ length: points }, (_, i) => readPoint(view, at + deflated + i * POINT_BYTES)),
    isGrey,
    white: view.getUint32(68, true),
    black: view.getUint32(72, true),
    pixels: isGrey ? summed(pixels, columns) : pixels,
  };
}

/** @param {DataView} view @param {number} at @returns {Point} */
function readPoint(view, at) {
  const image = [4, 8, 12, 16].map((offset) => view.getFloat32(at + offset, true));
  return { target: view.getUint32(at, true), image, residual: view.getFloat32(at + 20, true) };
}

/** Grey values of what is sent: each as its difference from the one to its left. @param {Uint8Array} differences @param {number} columns */
function summed(differences, columns) {
  for (let start = 0; start < differences.length; start += columns) {
    for (let i = start + 1; i < start + columns; i += 1) differences[i] += differences[i - 1];
  }
  return differences;
}

/** @param {ArrayBuffer} deflated */
async function inflate(deflated) {
  const stream = new Blob([deflated]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}
