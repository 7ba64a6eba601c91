// The verdict on a calibration, from its report. Nothing here touches the page.

/** @import { CalibrationReport, PerAxis } from "types/documents" */

const SEEN = 0.9;
const DROPPED = 0.03;
const UNMODELLED_PX = 0.15;
const SIGMA_MM = 0.15;
const FIELDS = 16;
const SIGMA0 = [0.5, 2];
/** @type {(keyof PerAxis)[]} */
const AXES = ["x", "y", "z"];

/**
 * @typedef {object} Verdict
 * @property {boolean} accept
 * @property {Reason[]} reasons
 *
 * @typedef {object} Reason
 * @property {string} key of calibration.reasons
 * @property {{mm?: number, px?: number, sigma0?: number, view?: string, n?: number, of?: number, left?: number, right?: number}} values
 */

/** @param {CalibrationReport} report @returns {Verdict} what speaks against it; where nothing does, what speaks for it */
export function judge(report) {
  const against = [...seen(report), ...dropped(report), ...precision(report), ...model(report)];
  return against.length ? { accept: false, reasons: against } : { accept: true, reasons: inFavour(report) };
}

/** @param {CalibrationReport} report @returns {Reason[]} */
function seen({ identification, capture }) {
  const few = Object.entries(identification.found).filter(([, found]) => found < SEEN * identification.of);
  const reasons = few.map(([view, found]) => ({ key: "few", values: { view, n: found, of: identification.of } }));
  return capture && capture.fields < FIELDS ? [...reasons, { key: "short", values: { n: capture.fields } }] : reasons;
}

/** @param {CalibrationReport} report @returns {Reason[]} */
function dropped({ blunders, result }) {
  const all = result.image_points + blunders.length;
  return blunders.length > DROPPED * all ? [{ key: "dropped", values: { n: blunders.length, of: all } }] : [];
}

/** @param {CalibrationReport} report @returns {Reason[]} */
function precision(report) {
  const mm = sigma(report).typical.xyz;
  const heldOut = report.validation?.rmse_mm.xyz;
  const coarse = mm > SIGMA_MM ? [{ key: "coarse", values: { mm } }] : [];
  return heldOut !== undefined && heldOut > SIGMA_MM ? [...coarse, { key: "missed", values: { mm: heldOut } }] : coarse;
}

/** @param {CalibrationReport} report @returns {Reason[]} */
function model({ result }) {
  const off = result.unmodelled_px > UNMODELLED_PX ? [{ key: "unmodelled", values: { px: result.unmodelled_px } }] : [];
  const isOdd = result.sigma0 < SIGMA0[0] || result.sigma0 > SIGMA0[1];
  return isOdd ? [...off, { key: "sigma0", values: { sigma0: result.sigma0 } }] : off;
}

/** @param {CalibrationReport} report @returns {Reason[]} */
function inFavour(report) {
  const { found, of } = report.identification;
  const heldOut = report.validation?.rmse_mm.xyz;
  return [
    { key: "found", values: { left: found.left, right: found.right, of } },
    { key: "fine", values: { mm: sigma(report).typical.xyz } },
    ...(heldOut ? [{ key: "met", values: { mm: heldOut } }] : []),
  ];
}

/**
 * Expected σ in mm over the volume: its median and its largest, by axis and of all three together. Where a view does
 * not reach there is none.
 * @param {Pick<CalibrationReport, "volume">} report
 */
export function sigma({ volume }) {
  const [x, y, z] = AXES.map((axis) => volume.planes.flatMap((plane) => plane.total[axis].flat().map((one) => one ?? NaN)));
  const xyz = x.map((one, i) => Math.hypot(one, y[i], z[i]));
  const [by_x, by_y, by_z, by_xyz] = [x, y, z, xyz].map((values) => values.filter(Number.isFinite).sort((a, b) => a - b));
  const at = (/** @type {(values: number[]) => number} */ pick) => ({ x: pick(by_x), y: pick(by_y), z: pick(by_z), xyz: pick(by_xyz) });
  return { typical: at((values) => values[Math.floor(values.length / 2)]), worst: at((values) => values[values.length - 1]) };
}
