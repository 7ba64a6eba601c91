// A virtual camera as a pyramid: its projection centre, and what its half of the picture sees.
// R = Rκ·Rφ·Rω, the camera looks along −z; a left-handed one (odd number of mirrors) is diag(−1, 1, 1)·R.
// The lens's distortion, a few pixels, is left out: at the size drawn it is not to be seen.

/** @import { Calibration, CalibrationView } from "types/documents" */

/**
 * @typedef {object} Frustum
 * @property {string} name of the view
 * @property {number[]} apex_mm projection centre
 * @property {number[][]} corners_mm of its half of the picture, at the given distance: one after the other round
 */

/**
 * @param {Calibration} calibration
 * @param {number} reach_mm how long the pyramids are
 * @returns {Frustum[]}
 */
export function frustaOf(calibration, reach_mm) {
  const lines = calibration.image.lines;
  return Object.entries(calibration.views).map(([name, view]) => {
    const apex_mm = [view.X0_mm, view.Y0_mm, view.Z0_mm];
    const outline = [
      [view.first_column, 0], [view.end_column - 1, 0], [view.end_column - 1, lines - 1], [view.first_column, lines - 1],
    ];
    const corners_mm = outline.map(([x, y]) => rayOf(view, x, y).map((part, i) => apex_mm[i] + reach_mm * part));
    return { name, apex_mm, corners_mm };
  });
}

/**
 * The direction that a frame pixel looks in, in the object's frame; one unit long along the camera's axis.
 * @param {Pick<CalibrationView, "x0_px" | "y0_px" | "pixel_x_mm" | "pixel_y_mm" | "f_mm" | "handedness" | "omega_rad" | "phi_rad" | "kappa_rad">} view
 * @param {number} column
 * @param {number} line
 * @returns {number[]}
 */
export function rayOf(view, column, line) {
  const x = (column - view.x0_px) * view.pixel_x_mm;
  const y = -(line - view.y0_px) * view.pixel_y_mm;
  const camera = [(view.handedness * x) / view.f_mm, y / view.f_mm, -1];
  const R = rotation(view.omega_rad, view.phi_rad, view.kappa_rad);
  return [0, 1, 2].map((i) => R[0][i] * camera[0] + R[1][i] * camera[1] + R[2][i] * camera[2]);
}

/** Rκ·Rφ·Rω as rows. @param {number} omega @param {number} phi @param {number} kappa @returns {number[][]} */
export function rotation(omega, phi, kappa) {
  const [so, co, sp, cp, sk, ck] = [omega, phi, kappa].flatMap((angle) => [Math.sin(angle), Math.cos(angle)]);
  const Romega = [[1, 0, 0], [0, co, so], [0, -so, co]];
  const Rphi = [[cp, 0, -sp], [0, 1, 0], [sp, 0, cp]];
  const Rkappa = [[ck, sk, 0], [-sk, ck, 0], [0, 0, 1]];
  return product(Rkappa, product(Rphi, Romega));
}

/** @param {number[][]} a @param {number[][]} b */
function product(a, b) {
  return a.map((row) => [0, 1, 2].map((j) => row[0] * b[0][j] + row[1] * b[1][j] + row[2] * b[2][j]));
}
