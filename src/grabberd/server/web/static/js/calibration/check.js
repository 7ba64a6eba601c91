// The ten-second check: the calibration frame is captured and held against the active calibration.
import { statusOf } from "../core/api.js";
import { el, fill, setText, symbol } from "../core/dom.js";
import { deviceOf } from "../core/store.js";
import { createJob } from "../jobs/job.js";
import { chosenFrame, knownFrames } from "./calibration_frames.js";
import { latestJob } from "./latest_job.js";
import { note } from "./steps.js";

/** @import { Context } from "../core/context.js" */
/** @import { CheckResult, Job, JobWith } from "types/documents" */

const CONFLICT = 409;
const LEVELS = /** @type {Record<string, string>} */ ({ fits: "good", doubtful: "warn", recalibrate: "bad" });

/** @param {Context} context */
export function createCheck(context) {
  const { t, store, api, format, may } = context;
  const job = createJob(context, { title: t("calibration.check.running"), done: show, busy, cancelled });
  const result = el("div", { class: "stack", role: "status" });
  const inPlace = el("input", { type: "checkbox" });
  const start = el("button", { class: "button", type: "button", data: { do: "check" }, "aria-describedby": "check-why", on: { click: submit } }, symbol("camera"), t("calibration.check.start"));
  const why = el("p", { class: "field-hint", id: "check-why" });
  const element = el("section", { class: "card stack", "aria-labelledby": "check-title" }, el("h2", { id: "check-title" }, t("calibration.check.title")), el("p", {}, t("calibration.check.about")),
    may("operator") && el("label", { class: "check" }, inPlace, t("calibration.check.inPlace")), may("operator") && el("div", { class: "row" }, start), why, job.element, result);
  let isBusy = false;
  let ended = false;

  async function open() {
    const device = context.device()?.name;
    const known = await latestJob(context, "check", (subject) => subject.replace(/^[^-]*-/, "") === device);
    if (known && !ended) job.follow(known);
  }

  async function submit() {
    const device = context.device()?.name;
    busy(true);
    fill(result);
    try {
      const frame = chosenFrame((await knownFrames(context)).frames);
      job.follow(await api.post(`/devices/${encodeURIComponent(device ?? "")}/check`, { body: { calibration_frame: frame?.name ?? null, in_place: inPlace.checked } }));
    } catch (problem) {
      context.refused(problem);
      busy(false);
    }
  }

  /** Its capture is of no use then. @param {Job} job */
  function cancelled({ subject }) {
    // Always asked: the state may not yet name a capture that has just begun. One that has ended is what is wanted.
    api.post(`/captures/${encodeURIComponent(subject)}/stop`).catch((problem) => statusOf(problem) === CONFLICT || context.refused(problem));
  }

  /** @param {boolean} on */
  function busy(on) {
    isBusy = on;
    enable();
  }

  function enable() {
    const device = deviceOf(store.get());
    const reason = !device?.calibration ? "none" : isBusy ? "" : device.capture_id || device.armed_capture_id ? "capturing" : device.sealing_capture_id ? "sealing" : "";
    start.disabled = isBusy || reason !== "";
    setText(why, may("operator") && reason ? t(`calibration.check.why.${reason}`) : "");
    why.hidden = why.textContent === "";
  }

  /** @param {JobWith<CheckResult>} job */
  function show({ result: found, created_utc }) {
    const facts = t("calibration.check.facts", { seen: found.seen, of: found.of, mm: format.number(found.rmse.xyz_mm, 3), px: format.number(found.parallax_px, 2) });
    fill(result, note(LEVELS[found.verdict], el("strong", { data: { check: found.verdict } }, t(`calibration.check.verdict.${found.verdict}`)), el("p", {}, t(`calibration.check.advice.${found.verdict}`))),
      el("p", { class: "small muted" }, format.moment(created_utc), " · ", facts),
      found.reasons.length ? el("p", { class: "small" }, el("strong", {}, t("lights.said")), " ", found.reasons.join(" – ")) : null);
  }

  const end = store.subscribe((known) => known, enable);
  open().catch(() => {}); // the banner says that the daemon is away
  return {
    element,
    unmount() {
      ended = true;
      end();
      job.unmount();
    },
  };
}
