// A job: its progress, a button to cancel it, and its outcome.
import { statusOf } from "../core/api.js";
import { el, fill, setText, symbol } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { Job, JobProblem, JobWith } from "types/documents" */

const EVERY_MS = 1000;
const ENDED = new Set(["done", "failed", "cancelled"]);

/**
 * @template Result what a job of this kind results in
 * @typedef {object} Hooks
 * @property {string} title what is being done
 * @property {(job: JobWith<Result>) => void} done it has succeeded
 * @property {(job: Job) => void} [cancelled] it has been cancelled here
 * @property {(busy: boolean) => void} [busy] it has started to run, or has ended
 */

/** @template Result @param {Context} context @param {Hooks<Result>} hooks */
export function createJob(context, hooks) {
  const { t, tn, api, format } = context;
  const bar = el("span");
  const meter = el("div", { class: "meter is-busy", role: "progressbar", "aria-label": hooks.title, "aria-valuemin": 0, "aria-valuemax": 100 }, bar);
  const words = el("p", { role: "status" });
  const cancel = el("button", { class: "button", type: "button", data: { do: "cancel-job" }, on: { click: end } }, symbol("close"), t("jobs.cancel"));
  const element = el("div", { class: "job stack", hidden: true });
  let id = "";
  let timer = 0;
  let turn = 0;

  /** Shows a job until it has ended. @param {Job} job */
  function follow(job) {
    id = job.id;
    fill(element, words, meter, context.may("operator") && el("div", { class: "row" }, cancel));
    element.hidden = false;
    hooks.busy?.(true);
    show(job);
  }

  /** @param {Job} job */
  function show(job) {
    clearTimeout(timer);
    if (ENDED.has(job.state)) return close(job);
    const percent = Math.round(100 * job.progress);
    bar.style.inlineSize = `${percent}%`;
    meter.setAttribute("aria-valuenow", String(percent));
    setText(words, job.state === "queued" ? queued(job) : t("jobs.running", { title: hooks.title, percent: format.number(percent) }));
    timer = setTimeout(look, EVERY_MS);
  }

  /** @param {Job} job */
  const queued = ({ position }) => (position ? tn("jobs.queued", position) : t("jobs.next"));

  async function look() {
    const mine = turn;
    try {
      const job = await api.get(`/jobs/${id}`);
      if (mine === turn) show(job); // else the panel has been left
    } catch (problem) {
      if (mine !== turn) return;
      if (statusOf(problem) === 404) fail({ message: t("jobs.gone"), hint: "" });
      else timer = setTimeout(look, 3 * EVERY_MS); // the banner says that the daemon is away
    }
  }

  async function end() {
    try {
      const job = await api.delete(`/jobs/${id}`);
      show(job);
      if (job.state === "cancelled") hooks.cancelled?.(job);
    } catch (problem) {
      context.refused(problem);
    }
  }

  /** @param {Job} job */
  function close(job) {
    if (job.state === "failed") return fail(job.problem);
    hooks.busy?.(false);
    element.hidden = job.state === "done";
    if (job.state === "done") hooks.done(/** @type {JobWith<Result>} */ (job));
    else fill(element, note("info", "is-idle", t("jobs.cancelled")));
  }

  /** @param {JobProblem | null} [problem] */
  function fail(problem) {
    hooks.busy?.(false);
    element.hidden = false;
    fill(element, note("bad", "is-bad", el("div", {}, el("strong", {}, problem?.message ?? t("jobs.failed")), problem?.hint && el("p", {}, problem.hint))));
  }

  /** Shows one that is under way already, as after the page was loaded anew. @param {string} kind @param {string} subject */
  async function resume(kind, subject) {
    const mine = turn;
    const page = await api.get("/jobs?limit=50").catch(() => null);
    const job = page?.jobs.find((one) => one.kind === kind && one.subject === subject && !ENDED.has(one.state));
    if (job && mine === turn && element.hidden) follow(job);
  }

  return {
    element, follow, resume,
    unmount() {
      turn += 1;
      clearTimeout(timer);
    },
  };
}

/** @param {string} name @param {string} level @param {Node | string} body */
const note = (name, level, body) => el("div", { class: `note ${level}`, role: "alert" }, symbol(name), body instanceof Node ? body : el("p", {}, body));
