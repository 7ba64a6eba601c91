// The points of a capture, a part of it at a time, and the states that its analyses have made of them.
import { column } from "../analysis/tables.js";
import { displacement, measuredMoment, momentOf } from "./moments.js";
import { frustaOf } from "./frustum.js";
import { gridOf } from "./grid.js";
import { MEASURED, REACH_MM } from "./live_source.js";

/** @import { Moment } from "./moments.js" */
/** @import { Frustum } from "./frustum.js" */
/** @import { Grid } from "./grid.js" */
/** @import { AnalysisRow, Capture } from "types/documents" */
/** @import { AnalysisMap } from "types/open_documents" */
/** @import { Api } from "types/routes" */

/** Fields played at a time: five seconds, without leaving any out. */
export const PART_FIELDS = 250;
const ANALYSED = ["contact_kpa", "strain1", "strain2", "tension1_n_per_m"];
const AT_ONCE = 4;

/**
 * @typedef {object} Opened
 * @property {Capture} capture
 * @property {number | null} run
 * @property {AnalysisRow[]} analyses those that succeeded
 * @property {Grid | null} grid
 * @property {Frustum[]} frusta
 * @property {number} parts
 *
 * @typedef {Opened & {grid: Grid}} Drawable
 *
 * @typedef {object} Played
 * @property {Moment[]} moments
 * @property {number[]} times_s of them, from the capture's first field
 * @property {string[]} quantities that there are values of
 */

/** Loads what is needed to draw a capture. @param {Api} api @param {string} id @returns {Promise<Opened>} */
export async function openCapture(api, id) {
  const path = /** @type {const} */ (`/captures/${encodeURIComponent(id)}`);
  const [capture, listed] = await Promise.all([api.get(path), api.get(`${path}/analyses`)]);
  const run = capture.runs.at(-1);
  if (!run) return { capture, run: null, analyses: [], grid: null, frusta: [], parts: 0 };
  const { made_with } = await api.get(`${path}/runs/${run.run}`);
  const counts = Object.values(capture.ledger.counts);
  return {
    capture,
    run: run.run,
    analyses: listed.analyses.filter((one) => !one.problem),
    grid: made_with.object ? gridOf(made_with.object) : null,
    frusta: made_with.calibration ? frustaOf(made_with.calibration, REACH_MM) : [],
    parts: Math.max(1, Math.ceil(counts.reduce((sum, count) => sum + count, 0) / PART_FIELDS)),
  };
}

/**
 * The measured points of a part.
 * @param {Api} api
 * @param {Drawable} opened
 * @param {number} part from 0
 */
export async function measuredPart(api, opened, part) {
  const query = `run=${opened.run}&first_n=${part * PART_FIELDS}&end_n=${(part + 1) * PART_FIELDS}&max_points=40000`;
  const document = await api.get(`/captures/${encodeURIComponent(opened.capture.id)}/points?${query}`);
  const moments = document.fields.map((field) => measuredMoment(opened.grid, field));
  return { moments, times_s: document.fields.map((field) => field.time_s), quantities: MEASURED };
}

/**
 * The mean cycle of an analysis, phase by phase; pressures of the earlier, wrong way are left out.
 * @param {Api} api
 * @param {Drawable} opened
 * @param {number} number of the analysis
 */
export async function meanCycle(api, opened, number) {
  const path = /** @type {const} */ (`/captures/${encodeURIComponent(opened.capture.id)}/analyses/${number}`);
  const document = await api.get(path);
  const phases = column(document.tables.phases, "phase").filter((phase) => phase !== null);
  const period_s = column(document.tables.summary, "period_s")[0] ?? 1;
  const maps = await inTurn(phases, (phase) => api.get(`${path}/maps?phase=${phase}`));
  const outdated = opened.analyses.some((one) => one.analysis === number && one.outdated_pressure);
  const quantities = ANALYSED.filter((name) => !(outdated && name === "contact_kpa") && maps.some((map) => map.columns[name]?.some(Number.isFinite)));
  const moments = maps.map((map) => phaseMoment(opened.grid, map, quantities));
  return { moments, times_s: phases.map((phase) => phase * period_s), quantities: [...quantities, "displacement_mm"] };
}

/** @param {Grid} grid @param {AnalysisMap} map @param {string[]} names @returns {Moment} */
function phaseMoment(grid, map, names) {
  const moment = momentOf(grid, map.columns, names, { phase: map.phase });
  return { ...moment, values: { ...moment.values, displacement_mm: displacement(moment.xyz_mm, grid.nominal_mm) } };
}

/** A few at a time, in order. @template T, R @param {T[]} items @param {(item: T) => Promise<R>} ask @returns {Promise<R[]>} */
async function inTurn(items, ask) {
  /** @type {R[]} */
  const found = [];
  for (let i = 0; i < items.length; i += AT_ONCE) found.push(...(await Promise.all(items.slice(i, i + AT_ONCE).map(ask))));
  return found;
}
