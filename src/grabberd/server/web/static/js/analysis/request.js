// Asking for an analysis: what is known is there already, one press is enough; a value may still be changed.
import { ApiProblem, newKey, statusOf } from "../core/api.js";
import { el, setText, symbol } from "../core/dom.js";
import { createJob } from "../jobs/job.js";
import { createChanges } from "./changes.js";
import { createPreparation } from "./preparation.js";
import { keepDraft } from "./draft.js";

/** @import { Context } from "../core/context.js" */
/** @import { AnalysisPreparation, AnalysisResult, AnalysisRow, Capture, JobWith } from "types/documents" */

const PAUSE_MS = 500;

/**
 * @param {Context} context
 * @param {Capture} capture
 * @param {AnalysisRow[]} own its analyses
 * @param {(number: number) => void} made
 */
export function createRequest(context, capture, own, made) {
  const { t, api } = context;
  const path = /** @type {const} */ (`/captures/${encodeURIComponent(capture.id)}`);
  const why = el("p", { id: "analysis-why", role: "status" });
  const start = el("button", { class: "button primary large wide", type: "submit", data: { do: "analyse" }, "aria-describedby": "analysis-why" }, symbol("maps"), t("analysis.start"));
  const preparation = createPreparation(context, capture);
  const changes = createChanges(context, capture, own, soon);
  const job = createJob(context, { title: t("analysis.running"), busy: setBusy, done: (/** @type {JobWith<AnalysisResult>} */ ended) => end(ended.result.analysis) });
  const body = el("form", { class: "stack", novalidate: true, on: { submit: submit } }, el("div", { class: "stack" }, start, why), preparation.element, changes.element);
  const element = el("div", { class: "stack" }, job.element, body);
  /** @type {AnalysisPreparation | null} */
  let prepared = null;
  let key = newKey();
  let busy = false;
  let turn = 0;
  let timer = 0;

  /** Asked again a little after the last key, or when the daemon is back. */
  function soon() {
    clearTimeout(timer);
    prepared = null;
    tell();
    timer = setTimeout(prepare, PAUSE_MS);
  }

  async function prepare() {
    const mine = ++turn;
    if (changes.missing().length) return tell();
    try {
      const found = await api.post(`${path}/analysis/inputs`, { body: changes.request() });
      if (mine !== turn) return;
      prepared = found;
      preparation.show(found);
      changes.show(found);
    } catch (problem) {
      if (mine !== turn) return;
      const { message, hint } = problem instanceof ApiProblem && problem.status ? problem : { message: t("core.noAnswer"), hint: t("core.noAnswerHint") };
      preparation.fail(message, hint);
    }
    tell();
  }

  function tell() {
    const missing = changes.missing();
    const refused = Boolean(prepared?.problems?.length);
    // What has been changed is looked at by the daemon first; what is known it looks up itself.
    start.disabled = busy || refused || missing.length > 0 || (!prepared && changes.isChanged());
    setText(why, missing.length ? t("analysis.missing", { names: missing.join(", ") }) : "");
  }

  /** @param {boolean} now */
  function setBusy(now) {
    busy = now;
    body.hidden = now;
    tell();
  }

  /** @param {number} number */
  function end(number) {
    keepDraft(capture.id, null);
    made(number);
  }

  /** @param {Event} event */
  async function submit(event) {
    event.preventDefault();
    if (busy || start.disabled) return;
    start.disabled = true;
    try {
      const queued = await api.post(`${path}/analysis`, { body: changes.request(), key });
      key = newKey();
      job.follow(queued);
      element.scrollIntoView({ block: "nearest" });
    } catch (problem) {
      if (statusOf(problem)) key = newKey(); // without an answer it is the same intention
      context.refused(problem);
    }
    tell();
  }

  /** The job that waits or runs, as after the page was loaded anew. */
  async function resume() {
    const id = capture.analysis?.job;
    const found = id ? await api.get(`/jobs/${id}`).catch(() => null) : null;
    if (found && turn >= 0 && !busy) job.follow(found);
  }

  prepare();
  resume();
  const endOnline = context.store.subscribe((known) => known.connection.online, (online) => online && !prepared && !busy && turn > 0 && prepare());
  return {
    element,
    unmount() {
      turn = -Infinity;
      clearTimeout(timer);
      endOnline();
      job.unmount();
    },
  };
}
