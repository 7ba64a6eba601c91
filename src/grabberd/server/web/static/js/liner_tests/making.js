// A test in the making: its capture, then the job that evaluates it. Its address outlives a reload.
import { statusOf } from "../core/api.js";
import { el, fill, setText, symbol } from "../core/dom.js";
import { rateOf } from "../core/store.js";
import { createJob } from "../jobs/job.js";
import { note } from "./words.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture, JobWith, LinerTestResult, Recipe } from "types/documents" */

const EVERY_MS = 700;

/** @param {Context} context @param {Recipe} recipe @param {string} id of the capture */
export function createMaking(context, recipe, id) {
  const { t, api, may, format } = context;
  const path = /** @type {const} */ (`/captures/${encodeURIComponent(id)}`);
  const bar = el("span");
  const meter = el("div", { class: "meter is-busy", role: "progressbar", "aria-label": t("tests.making.capturing"), "aria-valuemin": 0, "aria-valuemax": 100 }, bar);
  const words = el("p", { role: "status", class: "tests-left" });
  const stop = el("button", { class: "button danger large wide", type: "button", data: { do: "stop-test" }, on: { click: end } }, symbol("stop"), t("operate.stop"));
  const job = createJob(context, { title: t("tests.making.evaluating"), done: (/** @type {JobWith<LinerTestResult>} */ { result }) => location.replace(`#test/${encodeURIComponent(result.test)}`) });
  const body = el("div", { class: "stack" }, meter, words, may("operator") && stop);
  const title = el("h2", {}, t("tests.making.capturing"));
  const element = el("section", { class: "card stack narrow" }, title, body, job.element);
  let timer = 0;
  let ended = false;

  async function look() {
    clearTimeout(timer);
    try {
      const capture = await api.get(path);
      if (!ended) await show(capture);
    } catch (problem) {
      if (ended) return;
      if (statusOf(problem) === 404) fill(element, note("bad", t("capture.gone")), again());
      else timer = setTimeout(look, 3 * EVERY_MS); // the banner says that the daemon is away
    }
  }

  /** @param {Capture} capture */
  async function show(capture) {
    if (capture.state !== "sealed") progress(capture);
    else if (recipe.several) return location.replace(`#tests/${recipe.kind}`);
    else if (await evaluate(capture)) return;
    timer = setTimeout(look, EVERY_MS);
  }

  /** @param {Capture} capture */
  function progress(capture) {
    const rate_hz = rateOf(context.device());
    const share = Math.min(1, capture.fields / (recipe.duration_s * rate_hz));
    const left_s = Math.max(0, recipe.duration_s - capture.fields / rate_hz);
    bar.style.inlineSize = `${Math.round(100 * share)}%`;
    meter.setAttribute("aria-valuenow", String(Math.round(100 * share)));
    setText(words, capture.state === "recording" ? t("tests.making.left", { s: format.number(Math.ceil(left_s)) }) : t("tests.making.sealing"));
    stop.hidden = capture.state !== "recording";
  }

  /** Follows the capture's evaluation; false while it is not known yet. @param {Capture} capture */
  async function evaluate({ analysis, labels }) {
    setText(title, t("tests.making.evaluating"));
    setText(words, t("tests.making.sealing"));
    meter.hidden = stop.hidden = true;
    if (!analysis) return false; // it is queued within a second
    body.hidden = true;
    if (analysis.job) {
      job.follow(await api.get(`/jobs/${analysis.job}`));
      return true;
    }
    const { tests } = await api.get(`/tests?limit=100${labels.liner ? `&liner=${encodeURIComponent(labels.liner)}` : ""}`);
    const made = tests.find(({ kind, captures }) => kind === recipe.kind && captures.includes(id));
    if (made) location.replace(`#test/${encodeURIComponent(made.id)}`);
    else fill(element, title, note("bad", el("strong", { lang: "en" }, analysis.problem?.message ?? t("tests.making.none")), el("p", { lang: "en" }, analysis.problem?.hint)), again());
    return true;
  }

  const again = () => el("div", { class: "row" }, el("a", { class: "button primary", href: `#tests/${recipe.kind}` }, t("tests.again")));

  /** What was captured until then is evaluated. */
  async function end() {
    stop.disabled = true;
    await api.post(`${path}/stop`).catch(context.refused);
    stop.disabled = false;
    if (!ended) look();
  }

  look();
  return {
    element,
    unmount() {
      ended = true;
      clearTimeout(timer);
      job.unmount();
    },
  };
}
