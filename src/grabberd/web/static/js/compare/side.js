// One of two captures that are compared: what is known of it.
import { sampleOf } from "../capture/sample.js";
import { gridOf } from "../scene/grid.js";
import { column } from "../analysis/tables.js";
import { depthOf, facingOf, widthOf } from "./course.js";

/** @import { PointSample } from "../capture/sample.js" */
/** @import { Grid } from "../scene/grid.js" */
/** @import { AnalysisRow, Calibration, Capture } from "types/documents" */
/** @import { Api } from "types/routes" */

const MOST_POINTS = 200_000;

/**
 * @typedef {object} Side
 * @property {Capture} capture
 * @property {PointSample | null} sample of its points
 * @property {Grid | null} grid of its object
 * @property {Calibration | null} calibration what its last run was made with
 * @property {AnalysisRow | null} analysis its newest that can be used
 */

/** @param {Api} api @param {string} id @returns {Promise<Side>} */
export async function openSide(api, id) {
  const path = pathOf(id);
  const [capture, listed] = await Promise.all([api.get(path), api.get(`${path}/analyses`)]);
  const run = capture.runs.at(-1);
  const made = run ? (await api.get(`${path}/runs/${run.run}`)).made_with : null;
  return {
    capture,
    sample: run ? await sampleOf(api, id) : null,
    grid: made?.object ? gridOf(made.object) : null,
    calibration: made?.calibration ?? null,
    analysis: listed.analyses.find((one) => !one.problem) ?? null,
  };
}

/** Movement of a side. @param {Api} api @param {Side} side @param {number | null} target null: the width of the middle section */
export async function courseOf(api, side, target) {
  if (!side.grid) return new Map();
  const pairs = facingOf(side.grid);
  const targets = target === null ? pairs.flat() : [target];
  const asked = targets.map((id) => `target=${id}`).join("&");
  const { fields } = await api.get(`${pathOf(side.capture.id)}/points?max_points=${MOST_POINTS}&${asked}`);
  return target === null ? widthOf(fields, pairs) : depthOf(fields, target);
}

/** Phase of each field by the newest analysis; null without one. @param {Api} api @param {Side} side */
export async function phasesOf(api, side) {
  if (!side.analysis) return null;
  const { tables } = await api.get(`${pathOf(side.capture.id)}/analyses/${side.analysis.analysis}`);
  const phase = column(tables.fields, "phase");
  const known = column(tables.fields, "n").map((n, i) => /** @type {[number, number]} */ ([n, phase[i]])).filter(([, share]) => share !== null);
  return known.length ? new Map(known) : null;
}

/** @param {string} id @returns {`/captures/${string}`} */
const pathOf = (id) => `/captures/${encodeURIComponent(id)}`;
