// The binary messages of every field's points: docs/reference/live.md byte for byte.

export const PROTOCOL = "grabberd.points.v1";
const MAGIC = 0x58425247; // "GRBX", little endian
const VERSION = 1;
const US_PER_MS = 1000;

/**
 * @typedef {object} PointsFrame
 * @property {number} n the field's number
 * @property {number} time_ms middle of its exposure, since 1970, by the daemon's clock
 * @property {number} sequence number of the message; those that are missing are fields this page was too slow for
 * @property {number} description number of the description that holds for it
 * @property {Uint32Array} target
 * @property {Float64Array} xyz_mm x, y, z of every target in turn
 * @property {Float32Array} covariance_mm2 xx, xy, xz, yy, yz, zz of every target in turn
 * @property {Float32Array} calibration_covariance_mm2 the same, from the calibration
 * @property {Float32Array} residual_px
 */

/** The columns are parts of the message, which is not copied. @param {ArrayBuffer} buffer @returns {PointsFrame} */
export function readPoints(buffer) {
  const view = new DataView(buffer);
  if (view.getUint32(0, true) !== MAGIC || view.getUint16(4, true) !== VERSION) throw new Error("no message of points");
  const count = view.getUint32(52, true);
  let at = view.getUint16(6, true);
  /**
   * @template T
   * @param {{ new (buffer: ArrayBuffer, at: number, length: number): T, BYTES_PER_ELEMENT: number }} kind
   * @param {number} width
   */
  const column = (kind, width) => {
    const values = new kind(buffer, at, count * width);
    at += count * width * kind.BYTES_PER_ELEMENT;
    return values;
  };
  return {
    n: Number(view.getBigUint64(8, true)),
    time_ms: Number(view.getBigInt64(24, true)) / US_PER_MS,
    sequence: Number(view.getBigUint64(40, true)),
    description: view.getUint32(48, true),
    xyz_mm: column(Float64Array, 3),
    covariance_mm2: column(Float32Array, 6),
    calibration_covariance_mm2: column(Float32Array, 6),
    residual_px: column(Float32Array, 1),
    target: column(Uint32Array, 1),
  };
}

/** @typedef {ReturnType<typeof columnsOf>} StreamedPoints */

/** A frame by the columns' names in the API's documents. @param {PointsFrame} frame */
export function columnsOf(frame) {
  const place = (/** @type {number} */ axis) => Array.from(frame.target, (_, i) => frame.xyz_mm[3 * i + axis]);
  const sigma = (/** @type {number} */ entry) => Array.from(frame.target, (_, i) => Math.sqrt(frame.covariance_mm2[6 * i + entry]));
  return {
    n: frame.n,
    utc: new Date(frame.time_ms).toISOString(),
    target: Array.from(frame.target),
    x_mm: place(0),
    y_mm: place(1),
    z_mm: place(2),
    sigma_x_mm: sigma(0),
    sigma_y_mm: sigma(3),
    sigma_z_mm: sigma(5),
    residual_px: Array.from(frame.residual_px),
  };
}
