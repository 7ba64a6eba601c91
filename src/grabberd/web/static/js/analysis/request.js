// Asking for an analysis.
import { newKey, statusOf } from "../core/api.js";
import { el, fill, setText, symbol } from "../core/dom.js";
import { createJob } from "../jobs/job.js";
import { createFound } from "../profiles/found.js";
import { createBursts } from "./bursts.js";
import { createForm } from "./form.js";
import { valuesOf } from "./inputs.js";
import { lastInputs } from "./take_over.js";

/** @import { Context } from "../core/context.js" */
/** @import { AnalysisResult, AnalysisRow, Capture, JobWith } from "types/documents" */
/** @import { AnalysisInputs } from "types/open_documents" */

/**
 * @param {Context} context
 * @param {Capture} capture
 * @param {AnalysisRow[]} own its analyses
 * @param {(number: number) => void} made
 */
export function createRequest(context, capture, own, made) {
  const { t, api, format } = context;
  const offer = el("div", { hidden: true });
  const why = el("p", { id: "analysis-why", role: "status" });
  const start = el("button", { class: "button primary", type: "submit", data: { do: "analyse" }, "aria-describedby": "analysis-why" }, symbol("maps"), t("analysis.start"));
  let key = newKey();
  let busy = false;
  /** @type {ReturnType<typeof createForm> | null} */
  let asked = null;
  const profiles = createFound(context, capture, () => asked?.tell());
  const form = (asked = createForm(context, tell, profiles.given));
  const bursts = createBursts(context, capture);
  const job = createJob(context, { title: t("analysis.running"), busy: setBusy, done: (/** @type {JobWith<AnalysisResult>} */ ended) => made(ended.result.analysis) });
  const body = el("form", { class: "stack", novalidate: true, on: { submit: submit } }, el("p", {}, t("analysis.ask")), offer, profiles.element, form.element, bursts.element, el("div", { class: "row" }, start, why));
  const element = el("div", { class: "stack" }, job.element, body);

  function tell() {
    const missing = asked?.missing() ?? [];
    start.disabled = busy || missing.length > 0;
    setText(why, missing.length ? t("analysis.missing", { names: missing.join(", ") }) : "");
  }

  /** @param {boolean} now */
  function setBusy(now) {
    busy = now;
    body.hidden = now;
    tell();
  }

  /** @param {Event} event */
  async function submit(event) {
    event.preventDefault();
    if (busy) return;
    start.disabled = true;
    try {
      const queued = await api.post(`/captures/${encodeURIComponent(capture.id)}/analysis`, { body: { ...form.request(), bursts: bursts.chosen(), profiles: profiles.wanted() }, key });
      key = newKey();
      job.follow(queued);
      element.scrollIntoView({ block: "start" });
    } catch (problem) {
      if (statusOf(problem)) key = newKey();
      context.refused(problem);
      tell();
    }
  }

  /** Inputs that were given before are taken over by a press, and seen before they are used. */
  async function offerLast() {
    const last = await lastInputs(api, capture, own);
    if (!last) return;
    const { values, dropped } = valuesOf(/** @type {AnalysisInputs} */ (last.analysis.inputs ?? {}));
    const name = t(last.of.id === capture.id ? "analysis.take.own" : "analysis.take.other", { n: last.analysis.analysis, when: format.moment(last.of.created_utc) });
    const left = el("p", { class: "field-hint", hidden: true }, dropped.map((what) => t(`analysis.take.dropped.${what}`)).join(" "));
    const take = () => {
      form.set(values);
      left.hidden = !dropped.length;
    };
    fill(offer, el("button", { class: "button", type: "button", data: { do: "take-over" }, on: { click: take } }, symbol("down"), name), left);
    offer.hidden = false;
  }

  tell();
  offerLast();
  job.resume("analyse", capture.id);
  return { element, unmount: job.unmount };
}
