// Whether a calibration may be accepted, from its report. Nothing here touches the page.

const SEEN = 0.9;
const DROPPED = 0.03;
const UNMODELLED_PX = 0.15;
const SIGMA_MM = 0.15;
const FIELDS = 16;
const SIGMA0 = [0.5, 2];
const AXES = ["x", "y", "z"];

/**
 * @typedef {object} Verdict
 * @property {boolean} accept
 * @property {{key: string, values: Record<string, any>}[]} reasons keys of calibration.reasons
 */

/** @param {any} report @returns {Verdict} what speaks against it; where nothing does, what speaks for it */
export function judge(report) {
  const against = [...seen(report), ...dropped(report), ...precision(report), ...model(report)];
  return against.length ? { accept: false, reasons: against } : { accept: true, reasons: inFavour(report) };
}

/** @param {any} report */
function seen({ identification, capture }) {
  const few = Object.entries(identification.found).filter(([, found]) => found < SEEN * identification.of);
  const reasons = few.map(([view, found]) => ({ key: "few", values: { view, n: found, of: identification.of } }));
  return capture?.fields < FIELDS ? [...reasons, { key: "short", values: { n: capture.fields } }] : reasons;
}

/** @param {any} report */
function dropped({ blunders, result }) {
  const all = result.image_points + blunders.length;
  return blunders.length > DROPPED * all ? [{ key: "dropped", values: { n: blunders.length, of: all } }] : [];
}

/** @param {any} report */
function precision(report) {
  const mm = sigma(report).typical.xyz;
  const heldOut = report.validation?.rmse_mm.xyz;
  const coarse = mm > SIGMA_MM ? [{ key: "coarse", values: { mm } }] : [];
  return heldOut > SIGMA_MM ? [...coarse, { key: "missed", values: { mm: heldOut } }] : coarse;
}

/** @param {any} report */
function model({ result }) {
  const off = result.unmodelled_px > UNMODELLED_PX ? [{ key: "unmodelled", values: { px: result.unmodelled_px } }] : [];
  const isOdd = result.sigma0 < SIGMA0[0] || result.sigma0 > SIGMA0[1];
  return isOdd ? [...off, { key: "sigma0", values: { sigma0: result.sigma0 } }] : off;
}

/** @param {any} report */
function inFavour(report) {
  const { found, of } = report.identification;
  const heldOut = report.validation?.rmse_mm.xyz;
  return [
    { key: "found", values: { left: found.left, right: found.right, of } },
    { key: "fine", values: { mm: sigma(report).typical.xyz } },
    ...(heldOut ? [{ key: "met", values: { mm: heldOut } }] : []),
  ];
}

/** Expected σ in mm over the volume: its median and its largest, by axis and of all three together. @param {any} report */
export function sigma({ volume }) {
  const by = Object.fromEntries(AXES.map((axis) => [axis, volume.planes.flatMap((/** @type {any} */ plane) => plane.total[axis].flat())]));
  const xyz = by.x.map((/** @type {number} */ x, /** @type {number} */ i) => Math.hypot(x, by.y[i], by.z[i]));
  const all = Object.entries({ ...by, xyz }).map(([name, values]) => [name, values.filter(Number.isFinite).sort((/** @type {number} */ a, /** @type {number} */ b) => a - b)]);
  return {
    typical: Object.fromEntries(all.map(([name, values]) => [name, values[Math.floor(values.length / 2)]])),
    worst: Object.fromEntries(all.map(([name, values]) => [name, values[values.length - 1]])),
  };
}
