// Step 4: both virtual cameras are adjusted: a job that can be watched and cancelled.
import { newKey } from "../core/api.js";
import { keep, keptText } from "../core/kept.js";
import { el, fill } from "../core/dom.js";
import { draftOf, keepDraft } from "../core/drafts.js";
import { createJob } from "../jobs/job.js";
import { latestJob } from "./latest_job.js";
import { createPoses, marksOf, posesWith } from "./poses.js";
import { addressOf, note, way } from "./steps.js";

/** @import { Context } from "../core/context.js" */

const COMPUTED = "calibration.computed";

/** @param {Context} context @param {string} id of the capture of the newest pose */
export function createAdjust(context, id) {
  const { t, api, may, go } = context;
  const draft = `calibration.${id}`;
  const job = createJob(context, { title: t("calibration.adjust.running"), done, busy: (on) => (form.hidden = on) });
  const made = el("div");
  const poses = createPoses(context, removed);
  let captures = posesWith(context, id);
  const words = el("input", { class: "input", id: "calibration-note", maxlength: 2000, autocomplete: "off", value: draftOf(draft)?.note ?? "", on: { input: () => keepDraft(draft, { note: words.value }) } });
  const start = el("button", { class: "button primary", type: "button", data: { do: "adjust" }, on: { click: submit } }, t("calibration.adjust.start"));
  const form = el("div", { class: "stack" },
    el("div", { class: "field" }, el("label", { class: "field-label", for: "calibration-note" }, t("calibration.adjust.note")), words, el("p", { class: "field-hint" }, t("calibration.adjust.noteHint"))),
    el("div", { class: "row between" }, el("div", { class: "row" }, way(addressOf("found", id), t("calibration.back")), way(addressOf("place"), t("calibration.poses.another"))), start));
  const element = el("section", { class: "card stack narrow" }, el("h2", {}, t("calibration.adjust.title")), el("p", {}, t("calibration.adjust.about")), poses.element, made, job.element, may("operator") ? form : note("idle", t("calibration.viewer")));
  let live = false;
  let ended = false;

  async function open() {
    await poses.show(captures);
    const known = isComputed() ? await latestJob(context, "calibrate", (subject) => subject === captures[0]) : null;
    if (ended) return;
    if (known) job.follow(known);
    if (known?.state === "done") return;
    live = true;
    const { calibrations } = await api.get("/calibrations");
    const before = calibrations.find((row) => row.capture === captures[0]);
    if (before && isComputed() && !ended) offer(before.id);
  }

  /** A job tells only the first of its captures: which others it had is kept here. */
  function isComputed() {
    const last = keptText(COMPUTED) ?? "";
    return last.split(" ")[0] === captures[0] ? last === captures.join(" ") : captures.length === 1;
  }

  /** @param {string} gone */
  function removed(gone) {
    captures = captures.filter((one) => one !== gone);
    if (gone === id) return captures.length ? location.replace(addressOf("adjust", captures.at(-1))) : context.go("calibration", "place");
    poses.show(captures).catch(context.refused);
  }

  /** Jobs are forgotten after a month, but not what they made. @param {string} calibration */
  function offer(calibration) {
    fill(made, note("good", el("p", {}, t("calibration.adjust.made")), way(addressOf("review", calibration), t("calibration.adjust.read"), "primary")));
  }

  /** @param {{result: {calibration: string}}} job */
  function done({ result }) {
    if (live) go("calibration", "review", result.calibration);
    else offer(result.calibration);
  }

  async function submit() {
    start.disabled = true;
    live = true;
    try {
      const { labels } = await api.get(`/captures/${encodeURIComponent(captures[0])}`);
      keep(COMPUTED, captures.join(" "));
      const marks = captures.flatMap((capture) => marksOf(capture).map((mark) => ({ ...mark, capture })));
      const body = { captures, calibration_frame: labels.calibration_frame, note: words.value.trim(), options: { marks } };
      const made = await api.post("/calibrations", { body, key: newKey() });
      keepDraft(draft, null);
      if ("progress" in made) job.follow(made); // a calibration itself answers only the import of one
    } catch (problem) {
      context.refused(problem);
    }
    start.disabled = false;
  }

  open().catch(context.refused);
  return {
    element,
    unmount() {
      ended = true;
      job.unmount();
      poses.unmount();
    },
  };
}
