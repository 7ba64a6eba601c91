// The binary messages of a replay: docs/reference/replay.md byte for byte.

const POINTS = 0x50525247; // "GRRP", little endian
const PICTURES = 0x46525247; // "GRRF"
const VERSION = 1;
const PLACE_BYTES = 16;
const OUTCOMES = ["received", "damaged", "no_signal"];

/**
 * @typedef {object} ReplayPoints the points of one field
 * @property {number} n
 * @property {number} time_s since the capture's first field
 * @property {Uint32Array} target
 * @property {Float32Array} xyz_mm x, y, z of every target in turn
 * @property {Float32Array} sigma_mm
 * @property {Float32Array} residual_px
 * @property {Float32Array} image_px x and y in the left view, x and y in the right one, of every target in turn
 *
 * @typedef {object} ReplayPicture
 * @property {number} n
 * @property {Blob} png
 * @property {number} y0
 * @property {number} yStep
 * @property {string} outcome
 */

/** The columns are parts of the message, which is not copied. @param {ArrayBuffer} buffer @returns {Map<number, ReplayPoints>} by field */
export function readPointStretch(buffer) {
  const view = checked(buffer, POINTS);
  const first = Number(view.getBigUint64(8, true));
  const [fields, points] = [view.getUint32(16, true), view.getUint32(20, true)];
  let at = view.getUint16(6, true);
  /**
   * @template T
   * @param {{ new (buffer: ArrayBuffer, at: number, length: number): T, BYTES_PER_ELEMENT: number }} kind
   * @param {number} count
   */
  const column = (kind, count) => {
    const values = new kind(buffer, at, count);
    at += count * kind.BYTES_PER_ELEMENT;
    return values;
  };
  const time_s = column(Float64Array, fields);
  const [n, counts] = [column(Uint32Array, fields), column(Uint32Array, fields)];
  const target = column(Uint32Array, points);
  const [xyz_mm, sigma_mm, residual_px, image_px] = [3, 1, 1, 4].map((width) => column(Float32Array, width * points));
  /** @type {Map<number, ReplayPoints>} */
  const found = new Map();
  let from = 0;
  for (let i = 0; i < fields; i += 1) {
    const end = from + counts[i];
    found.set(first + n[i], {
      n: first + n[i], time_s: time_s[i], target: target.subarray(from, end), xyz_mm: xyz_mm.subarray(3 * from, 3 * end),
      sigma_mm: sigma_mm.subarray(from, end), residual_px: residual_px.subarray(from, end), image_px: image_px.subarray(4 * from, 4 * end),
    });
    from = end;
  }
  return found;
}

/** @param {ArrayBuffer} buffer @returns {Map<number, ReplayPicture>} by field */
export function readPictureStretch(buffer) {
  const view = checked(buffer, PICTURES);
  const first = Number(view.getBigUint64(8, true));
  const count = view.getUint32(16, true);
  let at = view.getUint16(6, true);
  let from = at + PLACE_BYTES * count;
  /** @type {Map<number, ReplayPicture>} */
  const found = new Map();
  for (let i = 0; i < count; i += 1, at += PLACE_BYTES) {
    const n = first + view.getUint32(at, true);
    const length = view.getUint32(at + 4, true);
    const png = new Blob([new Uint8Array(buffer, from, length)], { type: "image/png" });
    found.set(n, { n, png, y0: view.getUint16(at + 8, true), yStep: view.getUint16(at + 10, true), outcome: OUTCOMES[view.getUint8(at + 12)] ?? "received" });
    from += length;
  }
  return found;
}

/** @param {ArrayBuffer} buffer @param {number} magic */
function checked(buffer, magic) {
  const view = new DataView(buffer);
  if (buffer.byteLength < 24 || view.getUint32(0, true) !== magic || view.getUint16(4, true) !== VERSION) throw new Error("no message of a replay");
  return view;
}
