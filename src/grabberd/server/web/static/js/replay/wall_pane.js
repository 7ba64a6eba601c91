// The wall in space at the playhead's field, coloured by what was measured, or by what its analysis has found.
import { el, fill, symbol } from "../core/dom.js";
import { MEASURED } from "../scene/live_source.js";
import { displacement, momentOf } from "../scene/moments.js";
import { createViewer } from "../scene/viewer.js";

/** @import { Context } from "../core/context.js" */
/** @import { Grid } from "../scene/grid.js" */
/** @import { Moment } from "../scene/moments.js" */
/** @import { Scale } from "../scene/scale.js" */
/** @import { AnalysisMap } from "types/open_documents" */
/** @import { ReplayPoints } from "./messages.js" */
/** @import { Measured } from "./source.js" */

/** Quantities of a map that a target can be coloured by. */
export const ANALYSED = ["contact_kpa", "strain1", "strain2", "tension1_n_per_m"];

/**
 * @param {Context} context
 * @param {object} about
 * @param {string} about.id of the capture
 * @param {number} about.field_s from field to field
 * @param {Measured | null} about.measured
 * @param {string[]} about.analysed quantities that its analysis has
 * @param {(quantity: string) => Scale | null} about.scaleOf the scale of one of them
 * @param {(target: number | null) => void} about.chosen told of the target that is touched
 */
export function createWallPane(context, { id, field_s, measured, analysed, scaleOf, chosen }) {
  const { t, format } = context;
  const element = el("div", { class: "replay-body" });
  const grid = measured?.grid ?? null;
  if (!measured || !grid) {
    fill(element, el("div", { class: "note is-warn" }, symbol("warn"), el("p", {}, t(measured ? "replay.noObject" : "replay.noPoints"))));
    return { element, show: () => {}, picture: () => null, end: () => {} };
  }
  const when = (/** @type {Moment} */ moment) => t("shape.whenField", { n: moment.n ?? 0, seconds: format.number((moment.n ?? 0) * field_s, 2) });
  const viewer = createViewer(context, { grid, frusta: measured.frusta, quantities: [...analysed, ...MEASURED], when, file: id, scaleOf, chosen, compact: true });
  fill(element, viewer.element);

  return {
    element,
    /** @param {number} n @param {ReplayPoints | undefined} points @param {AnalysisMap | null} map */
    show: (n, points, map) => viewer.show(replayMoment(grid, n, points, map, analysed)),
    /** The drawing, with its legend: drawn at once, so that it can be copied. */
    picture: viewer.picture,
    end: viewer.end,
  };
}

/**
 * A field's points on the grid, with what a map says of the same targets.
 * @param {Grid} grid
 * @param {number} n
 * @param {ReplayPoints | undefined} points none: nothing was seen
 * @param {AnalysisMap | null} map
 * @param {string[]} analysed
 * @returns {Moment}
 */
export function replayMoment(grid, n, points, map, analysed) {
  const count = grid.target.length;
  const empty = () => new Float32Array(count).fill(NaN);
  const [xyz_mm, sigma_mm, residual_px] = [new Float32Array(3 * count).fill(NaN), empty(), empty()];
  let seen = 0;
  for (let i = 0; points && i < points.target.length; i += 1) {
    const place = grid.index.get(points.target[i]);
    if (place === undefined) continue;
    xyz_mm.set(points.xyz_mm.subarray(3 * i, 3 * i + 3), 3 * place);
    sigma_mm[place] = points.sigma_mm[i];
    residual_px[place] = points.residual_px[i];
    seen += 1;
  }
  const found = map ? momentOf(grid, map.columns, analysed.filter((name) => map.columns[name])).values : {};
  const values = { sigma_mm, residual_px, displacement_mm: displacement(xyz_mm, grid.nominal_mm), ...found };
  return { n, time_s: points?.time_s ?? null, phase: null, utc: null, xyz_mm, seen, values };
}
