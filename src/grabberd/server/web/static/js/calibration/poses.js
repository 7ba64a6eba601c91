// The poses of the calibration frame that were captured for one calibration, and what was found in each.
import { el, fill, symbol } from "../core/dom.js";
import { keep, kept } from "../core/kept.js";
import { latestJob } from "./latest_job.js";
import { note } from "./steps.js";

/** @import { Context } from "../core/context.js" */
/** @import { Identification, TargetMark } from "types/documents" */

const POSES = "calibration.poses";
const MARKS = "calibration.marks";
export const MOST_POSES = 16;

/** Captures of the poses taken so far, the oldest first. @param {Context} context @returns {string[]} */
export function posesTaken(context) {
  const known = /** @type {{device?: unknown, captures?: unknown} | null} */ (kept(POSES));
  if (!known || known.device !== (context.device()?.name ?? null) || !Array.isArray(known.captures)) return [];
  return known.captures.filter((one) => typeof one === "string");
}

/** Those that a capture belongs to; it alone where it is none of them. @param {Context} context @param {string} id @returns {string[]} */
export function posesWith(context, id) {
  const poses = posesTaken(context);
  return poses.includes(id) ? poses : [id];
}

/** @param {Context} context @param {string} id of the capture of another pose */
export function addPose(context, id) {
  const poses = posesTaken(context);
  if (!poses.includes(id)) keepPoses(context, [...poses, id].slice(-MOST_POSES));
}

/** @param {Context} context @param {string} id */
export function removePose(context, id) {
  keepPoses(context, posesTaken(context).filter((one) => one !== id));
}

export function forgetPoses() {
  keep(POSES, null);
  keep(MARKS, null);
}

/** Targets that somebody has named in a capture's picture. @param {string} id @returns {TargetMark[]} */
export function marksOf(id) {
  const all = /** @type {Record<string, TargetMark[]> | null} */ (kept(MARKS));
  return all && Array.isArray(all[id]) ? all[id] : [];
}

/** @param {string} id @param {TargetMark[]} marks */
export function keepMarks(id, marks) {
  keep(MARKS, { .../** @type {object | null} */ (kept(MARKS)), [id]: marks });
}

/** @param {Context} context @param {string[]} captures */
function keepPoses(context, captures) {
  keep(POSES, captures.length ? { device: context.device()?.name ?? null, captures } : null);
}

/**
 * The list of poses with the targets found in each.
 * @param {Context} context
 * @param {(id: string) => void} removed what happens once one was removed
 */
export function createPoses(context, removed) {
  const { t, may } = context;
  const list = el("ol", { class: "poses stack tight" });
  const element = el("section", { class: "stack tight", "aria-labelledby": "poses-title" }, el("h3", { id: "poses-title" }, t("calibration.poses.title")), list, el("p", { class: "field-hint" }, t("calibration.poses.about")));
  let ended = false;

  /** @param {string[]} poses */
  async function show(poses) {
    const found = await Promise.all(poses.map((id) => latestJob(context, "identify", (subject) => subject === id)));
    if (ended) return;
    fill(list, ...poses.map((id, i) => item(id, i + 1, found[i]?.state === "done" ? /** @type {Identification} */ (found[i]?.result) : null)));
  }

  /** @param {string} id @param {number} number @param {Identification | null} found */
  function item(id, number, found) {
    const words = found ? t("calibration.poses.found", { left: found.views.left.found.length, right: found.views.right.found.length, of: found.of }) : t("calibration.poses.unknown");
    const name = t("calibration.poses.pose", { n: number });
    const remove = may("operator") && el("button", { class: "button", type: "button", data: { do: "remove-pose" }, "aria-label": t("calibration.poses.removeOf", { n: number }), on: { click: () => take(id) } }, symbol("close"), t("calibration.poses.remove"));
    return el("li", { class: "row between", data: { pose: id } }, el("span", {}, el("strong", {}, name), " – ", words), remove);
  }

  /** @param {string} id */
  function take(id) {
    removePose(context, id);
    removed(id);
  }

  return { element, show, unmount: () => void (ended = true) };
}

/** How the calibration frame stands for another pose; nothing for the first. @param {Context} context */
export function poseHint(context) {
  const taken = posesTaken(context).length;
  return taken ? note("idle", el("strong", {}, context.t("calibration.poses.next", { n: taken + 1 })), el("p", {}, context.t("calibration.poses.how"))) : null;
}
