// What a calibration's report says, in the page's terms. Nothing here touches the page.

/** @import { CalibrationAcceptance, CalibrationReport, PerAxis, ViewValidity } from "types/documents" */
/** @import { Scale } from "../scene/scale.js" */

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

/** σ of all axes together at each node, NaN where one is not known. @param {ViewValidity["point_mm"]} grids */
export function lengthsOf(grids) {
  const [first, ...others] = Object.values(grids);
  return first.map((row, k) => row.map((one, i) => Math.hypot(one ?? NaN, ...others.map((grid) => grid[k][i] ?? NaN))));
}

/** Values with colours of their own go up to so many times what is usual in the calibration frame's volume. */
const MOST = 4;

/** The range of the colours over all views, as in the report; none where no place is known. @param {Pick<ViewValidity, "inside">[]} views @param {number[][][]} grids @returns {Scale | null} */
export function scaleOf(views, grids) {
  const known = grids.flat(2).filter(Number.isFinite);
  if (!known.length) return null;
  const within = grids.flatMap((grid, n) => grid.flatMap((row, k) => row.filter((one, i) => views[n].inside[k][i] && Number.isFinite(one))));
  const usual = (within.length ? within : known).sort((a, b) => a - b);
  const low = Math.min(...known);
  return { low, high: Math.max(Math.min(Math.max(...known), MOST * usual[Math.floor(usual.length / 2)]), low * 1.02 + 1e-9), map: "rising" };
}

/** Distance of the nodes. @param {number[]} nodes */
export const spacing = (nodes) => (nodes.length > 1 ? nodes[1] - nodes[0] : 1);
