// What a calibration's report says, in the page's terms. Nothing here touches the page.

/** @import { CalibrationAcceptance, CalibrationReport, PerAxis } from "types/documents" */

/** @type {(keyof PerAxis)[]} */
const AXES = ["x", "y", "z"];
/** @type {Record<CalibrationAcceptance["verdict"], "good" | "warn" | "bad">} */
export const LEVELS = { passed: "good", passed_with_remarks: "warn", failed: "bad" };

/**
 * @typedef {object} InFavour
 * @property {string} key of calibration.reasons
 * @property {{mm?: number, left?: number, right?: number, of?: number}} values
 */

/** What speaks for it, where nothing speaks against it. @param {CalibrationReport} report @returns {InFavour[]} */
export function inFavour(report) {
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
