// All that a replay is made of: a capture, one of its runs, what that was made with, and its analyses.
import { column, hasAny } from "../analysis/tables.js";
import { periodOf, totalOf } from "../captures/words.js";
import { ApiProblem } from "../core/api.js";
import { everyPage } from "../core/pages.js";
import { frustaOf } from "../scene/frustum.js";
import { gridOf } from "../scene/grid.js";
import { REACH_MM } from "../scene/live_source.js";
import { readPictureStretch, readPointStretch } from "./messages.js";

/** @import { Frustum } from "../scene/frustum.js" */
/** @import { Grid } from "../scene/grid.js" */
/** @import { Analysis, AnalysisRow, Calibration, Capture, Views } from "types/documents" */
/** @import { Api } from "types/routes" */

// The newest fields of a running capture, which may not be on the disk yet: it is written to twice a second.
const UNWRITTEN_S = 2;
/** Fields of a stretch, as the file has them together: of PAL a second of points, half a second of pictures. */
export const POINT_FIELDS = 50;
export const PICTURE_FIELDS = 25;

/**
 * @typedef {object} Measured what a run was made with
 * @property {number} run
 * @property {Grid | null} grid
 * @property {Calibration | null} calibration
 * @property {Frustum[]} frusta
 * @property {Views} views none without a calibration
 */

/** @param {string} id @returns {`/captures/${string}`} */
export const pathOf = (id) => `/captures/${encodeURIComponent(id)}`;

/** Number of fields that can be read: of a running capture the newest are not on the disk yet. @param {Capture} capture */
export function readableOf(capture) {
  return capture.verdict === null ? Math.max(0, totalOf(capture) - Math.round(UNWRITTEN_S / (periodOf(capture) || 1))) : totalOf(capture);
}

/** Outcome of a field, and its reason. @param {Capture} capture @param {number} n */
export function outcomeOf(capture, n) {
  const found = capture.ledger.entries.find((entry) => entry.first_n <= n && n < entry.first_n + entry.count);
  const last = capture.ledger.entries.at(-1);
  const unlisted = capture.ledger.entries_not_listed && last && n >= last.first_n + last.count;
  return found ?? { outcome: unlisted ? "unlisted" : "received", reason: "" };
}

/** @param {Api} api @param {string} id @param {number} run @returns {Promise<Measured>} */
export async function openRun(api, id, run) {
  const { made_with } = await api.get(`${pathOf(id)}/runs/${run}`);
  const { calibration, object } = made_with;
  const views = Object.entries(calibration?.views ?? {}).map(([name, { first_column, end_column }]) => [name, { first_column, end_column }]);
  return {
    run, calibration,
    grid: object ? gridOf(object) : null,
    frusta: calibration ? frustaOf(calibration, REACH_MM) : [],
    views: Object.fromEntries(views),
  };
}

/** Its newest analysis that succeeded; null without one. @param {Api} api @param {string} id @returns {Promise<{row: AnalysisRow, document: Analysis} | null>} */
export async function openAnalysis(api, id) {
  const pages = await everyPage((query) => api.get(`${pathOf(id)}/analyses?${query}`));
  const row = pages.flatMap((page) => page.analyses).find((one) => !one.problem);
  return row ? { row, document: await api.get(`${pathOf(id)}/analyses/${row.analysis}`) } : null;
}

/** Phase of each field that was analysed; null where none has one. @param {Analysis} document @returns {Map<number, number> | null} */
export function phasesOf(document) {
  const phase = column(document.tables.fields, "phase");
  if (!hasAny(phase)) return null;
  const known = column(document.tables.fields, "n").map((n, i) => /** @type {[number, number]} */ ([n, phase[i]]));
  return new Map(known.filter(([, share]) => share !== null));
}

/** @param {Api} api @param {string} id @param {() => number} run */
export function pointLoader(api, id, run) {
  return async (/** @type {number} */ first, /** @type {number} */ count, /** @type {AbortSignal} */ signal) =>
    readPointStretch(await binary(api.url(`${pathOf(id)}/replay/points?run=${run()}&first_n=${first}&count=${count}`), signal));
}

/** @param {Api} api @param {string} id */
export function pictureLoader(api, id) {
  return async (/** @type {number} */ first, /** @type {number} */ count, /** @type {AbortSignal} */ signal) =>
    readPictureStretch(await binary(api.url(`${pathOf(id)}/replay/pictures?first_n=${first}&count=${count}`), signal));
}

/** @param {string} address @param {AbortSignal} signal */
async function binary(address, signal) {
  const answer = await fetch(address, { signal }).catch((error) => {
    if (signal.aborted) throw error;
    throw new ApiProblem(0, { title: "no answer" });
  });
  if (!answer.ok) throw new ApiProblem(answer.status, await answer.json().catch(() => ({})));
  return answer.arrayBuffer().catch((error) => {
    if (signal.aborted) throw error;
    throw new ApiProblem(0, { title: "the answer broke off" });
  });
}
