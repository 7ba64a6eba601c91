// The runs of a capture, the calibrations they were made with, and re-measuring.
import { findingIn } from "../captures/words.js";
import { newKey, statusOf } from "../core/api.js";
import { el, fill, symbol } from "../core/dom.js";
import { createJob } from "../jobs/job.js";

/** @import { Context } from "../core/context.js" */
/** @import { PointSample } from "./sample.js" */
/** @import { Capture, FieldOrder, JobWith, MadeWith, MeasurementResult, Rig, Run } from "types/documents" */

const SHOWN = 6;
/** @type {Partial<Record<Rig["verdict"], [string, string]>>} level and symbol */
const RIG = { fits: ["good", "ok"], corrected: ["good", "ok"], doubtful: ["warn", "warn"], moved: ["bad", "bad"], unmatched: ["bad", "bad"] };

/** @param {Context} context @param {() => void} again the capture is to be looked at anew */
export function createRuns(context, again) {
  const { t, api, format, may } = context;
  const findings = el("div");
  const body = el("tbody");
  const heads = ["run", "how", "when", "calibration", "object"].map((name) => el("th", { scope: "col" }, t(`capture.runs.${name}`)));
  const table = el("div", { class: "scroll" }, el("table", { class: "table" }, el("thead", {}, el("tr", {}, heads)), body));
  const none = el("p", { class: "muted" }, t("capture.runs.none"));
  const measure = el("button", { class: "button", type: "button", data: { do: "measure" }, on: { click: submit } }, symbol("measure"), t("capture.runs.again"));
  const job = createJob(context, { title: t("capture.runs.measuring"), busy: (busy) => (measure.disabled = busy), done: ended });
  const warned = el("div");
  const hint = el("p", { class: "field-hint" }, t("capture.runs.hint"));
  const element = el("section", { class: "card stack" }, el("h2", {}, t("capture.runs.title")), findings, none, table, may("operator") && el("div", { class: "stack capture-measure" }, measure, hint), job.element, warned);
  /** @type {Map<number, {made_with: MadeWith}>} */
  const known = new Map();
  let id = "";
  let key = newKey();

  /** @param {Capture} capture @param {PointSample | null} sample of its points, or null */
  function show(capture, sample) {
    if (!id) job.resume("measure", capture.id);
    id = capture.id;
    none.hidden = capture.runs.length > 0;
    table.hidden = !capture.runs.length;
    measure.hidden = hint.hidden = capture.verdict === null || capture.state !== "sealed";
    fill(body, ...[...capture.runs].reverse().slice(0, SHOWN).map(row));
    fill(findings, quality(sample), coverage(capture), rig(/** @type {Rig | null | undefined} */ (capture.rig)), order(capture.field_order));
  }

  /** @param {Run} run */
  function row(run) {
    const made = el("td", {}, "…");
    const object = el("td", {}, "…");
    madeWith(run).then((made_with) => {
      fill(made, made_with?.calibration?.id ?? "–");
      fill(object, made_with?.object?.name ?? "–");
    });
    return el("tr", {}, el("td", {}, run.run), el("td", {}, how(run), run.coverage && el("div", { class: "muted small" }, t(`captures.measured.${run.coverage.verdict}`))), el("td", {}, format.moment(run.created_utc)), made, object);
  }

  /** A run that is done does not change. @param {Run} run */
  async function madeWith(run) {
    const found = known.get(run.run) ?? (await api.get(`/captures/${encodeURIComponent(id)}/runs/${run.run}`).catch(() => null));
    if (found) known.set(run.run, found);
    return found?.made_with;
  }

  /** @param {Run} run */
  function how(run) {
    const words = t(run.kind === "live" ? "capture.runs.live" : "capture.runs.later");
    return run.state === "done" ? words : `${words} (${t(run.state === "running" ? "capture.runs.running" : "capture.runs.broken")})`;
  }

  /** @param {PointSample | null} sample */
  function quality(sample) {
    if (!sample?.points) return null;
    return el("p", {}, t("capture.runs.quality", { targets: format.number(sample.targets, 0), residual: format.number(sample.residual_px, 3), sigma: format.number(sample.sigma_mm, 3) }));
  }

  /** What is to be said of how well it was measured. @param {Capture} capture */
  function coverage({ coverage: known }) {
    if (!known || known.verdict === "measured_well") return null;
    const words = known.findings.map((finding) => el("li", {}, findingIn(context, finding)));
    return el("div", { class: `note is-${known.verdict === "not_measured" ? "bad" : "warn"}` }, symbol("warn"), el("div", {}, t(`captures.measured.${known.verdict}`), el("ul", {}, words)));
  }

  /** @param {Rig | null | undefined} found */
  function rig(found) {
    if (!found) return null;
    const [level, sign] = RIG[found.verdict] ?? ["idle", "unknown"];
    const apart = found.shift_px === null ? "" : ` ${t("capture.runs.shift", { px: format.number(found.shift_px, 2) })}`;
    return el("p", { class: `note is-${level}` }, symbol(sign), el("span", {}, `${t("lights.rig.title")}: ${t(`lights.rig.words.${found.verdict}`)}.`, apart));
  }

  /** Only what is wrong: a capture in which nothing moves has no order to see. @param {FieldOrder | null | undefined} found */
  function order(found) {
    if (found?.order !== "reversed" && found?.order !== "same_instant") return null;
    const zigzag = ` ${t("capture.runs.zigzag", { mm: format.number(found.zigzag_mm ?? 0, 2) })}`;
    return el("p", { class: "note is-bad" }, symbol("bad"), el("span", {}, `${t("lights.order.title")}: ${t(`lights.order.words.${found.order}`)}.`, zigzag));
  }

  async function submit() {
    measure.disabled = true;
    fill(warned);
    try {
      const made = await api.post(`/captures/${encodeURIComponent(id)}/measure`, { key });
      key = newKey();
      job.follow(made);
    } catch (problem) {
      if (statusOf(problem)) key = newKey();
      measure.disabled = false;
      context.refused(problem);
    }
  }

  /** @param {JobWith<MeasurementResult>} ended */
  function ended({ result }) {
    const sentences = (result.warnings ?? []).map((words) => el("li", {}, words));
    fill(warned, sentences.length > 0 && el("div", { class: "note is-warn" }, symbol("warn"), el("div", {}, t("capture.runs.warnings"), el("ul", {}, sentences))));
    context.announce(t("capture.runs.measured"), { kind: "good" });
    again();
  }
  return { element, show, unmount: job.unmount };
}
