// What is asked for several captures, part by part: how far it is, and which of them failed and why.
import { newKey } from "../core/api.js";

/** @import { Context } from "../core/context.js" */
/** @import { Batch, Capture, CapturesPatch } from "types/documents" */

/** So few that each part is answered at once. */
const PART = 20;

/**
 * @typedef {object} Outcome
 * @property {string[]} done ids
 * @property {Batch["failed"]} failed
 */

/**
 * Asks part by part; ends with the first part that is refused as a whole, which is thrown.
 * @param {Capture[]} captures
 * @param {(ids: string[]) => Promise<Batch>} ask
 * @param {(done: number) => void} progress
 * @returns {Promise<Outcome>}
 */
async function inParts(captures, ask, progress) {
  /** @type {Outcome} */
  const outcome = { done: [], failed: [] };
  for (let first = 0; first < captures.length; first += PART) {
    const { done, failed } = await ask(captures.slice(first, first + PART).map((one) => one.id));
    outcome.done.push(...done);
    outcome.failed.push(...failed);
    progress(outcome.done.length + outcome.failed.length);
  }
  return outcome;
}

/** @param {Context} context @param {Capture[]} captures @param {Omit<CapturesPatch, "captures">} change @param {(done: number) => void} progress */
export const annotate = ({ api }, captures, change, progress) => inParts(captures, (ids) => api.patch("/captures", { body: { ...change, captures: ids } }), progress);

/** @param {Context} context @param {Capture[]} captures @param {(done: number) => void} progress */
export const remove = ({ api }, captures, progress) => inParts(captures, (ids) => api.post("/captures/deletion", { body: { captures: ids } }), progress);

/** @param {Context} context @param {Capture[]} captures @param {(done: number) => void} progress */
export const analyse = ({ api }, captures, progress) => inParts(captures, (ids) => api.post("/captures/analysis", { body: { captures: ids }, key: newKey() }), progress);
