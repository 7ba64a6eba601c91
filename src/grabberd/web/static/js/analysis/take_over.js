// Inputs that were given before, for this capture or this liner: offered, never taken by themselves.

/** @import { AnalysisRow, Capture } from "types/documents" */
/** @import { Api } from "types/routes" */

const LOOKED_AT = 8;

/**
 * The last analysis whose inputs may be meant again.
 * @param {Api} api
 * @param {Capture} capture
 * @param {AnalysisRow[]} own its analyses, newest first
 * @returns {Promise<{analysis: AnalysisRow, of: Capture} | null>} `of`: the capture it is of
 */
export async function lastInputs(api, capture, own) {
  const mine = own.find(hasInputs);
  if (mine) return { analysis: mine, of: capture };
  const found = await api.get(`/captures?limit=${LOOKED_AT}&${new URLSearchParams({ device: capture.device, ...(capture.labels.liner ? { search: capture.labels.liner } : {}) })}`).catch(() => ({ captures: [] }));
  for (const other of found.captures.filter((one) => one.id !== capture.id)) {
    const { analyses } = await api.get(`/captures/${encodeURIComponent(other.id)}/analyses`).catch(() => ({ analyses: [] }));
    const theirs = analyses.find(hasInputs);
    if (theirs) return { analysis: theirs, of: other };
  }
  return null;
}

/** @param {AnalysisRow} analysis */
const hasInputs = (analysis) => !analysis.problem && Object.keys(analysis.inputs ?? {}).length > 0;
