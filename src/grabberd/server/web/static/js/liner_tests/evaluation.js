// The captures of a test that compares several: chosen, and evaluated together.
import { newKey, statusOf } from "../core/api.js";
import { el, fill, setText, symbol } from "../core/dom.js";
import { createJob } from "../jobs/job.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture, JobWith, LinerTestResult, Recipe } from "types/documents" */

const MOST = 100;
/** Captures of these recipes tell of wear. */
const OF_WEAR = ["ramp", "milking"];
const REFERENCE = "reference";

/** @param {Capture} capture */
const isReference = ({ labels }) => labels.test === REFERENCE;

/** @param {Context} context @param {Recipe} recipe */
export function createEvaluation(context, recipe) {
  const { t, api, may, format } = context;
  const { kind } = recipe;
  const list = el("ul", { class: "tests-list" });
  const why = el("p", { class: "start-why", id: "evaluate-why", role: "status" });
  const evaluate = el("button", { class: "button primary large wide", type: "button", data: { do: "evaluate" }, "aria-describedby": "evaluate-why", on: { click: submit } }, symbol("maps"), t("tests.evaluate.do"));
  const job = createJob(context, { title: t("tests.making.evaluating"), busy: setBusy, done: (/** @type {JobWith<LinerTestResult>} */ { result }) => context.go("test", result.test) });
  const element = el("section", { class: "card stack", "aria-labelledby": "tests-captures" }, el("h2", { id: "tests-captures" }, t("tests.evaluate.title")), el("p", { class: "field-hint" }, t(`tests.evaluate.about.${kind}`)), list, job.element, may("operator") && el("div", { class: "stack" }, evaluate, why));
  /** @type {Capture[]} */
  let offered = [];
  let chosen = new Set();
  let key = newKey();
  let busy = false;
  let turn = 0;

  /** Offers the captures of a liner. @param {string} liner */
  async function show(liner) {
    const mine = ++turn;
    offered = [];
    tell();
    if (!liner.trim()) return fill(list);
    const found = await capturesOf(liner.trim()).catch(context.refused);
    const tested = await api.get(`/tests?${new URLSearchParams({ kind, liner: liner.trim(), limit: String(MOST) })}`).catch(() => null);
    if (mine !== turn || !found) return;
    const before = new Set(kind === "wear" ? [] : tested?.tests.flatMap(({ captures }) => captures));
    const reference = found.find(isReference);
    // With the steps goes the newest reference state, whichever test had it before.
    offered = found.filter((one) => !isReference(one) || one === reference);
    chosen = new Set(offered.filter((one) => one === reference || !before.has(one.id)).map(({ id }) => id));
    fill(list, ...(offered.length ? offered.map(item) : [el("li", { class: "muted" }, t("tests.evaluate.none"))]));
    tell();
    const jobs = await api.get("/jobs?limit=50").catch(() => null);
    const running = jobs?.jobs.find((one) => one.kind === "test" && !one.ended_utc && offered.some(({ id }) => id === one.subject));
    if (running && mine === turn && job.element.hidden) job.follow(running);
  }

  /** Newest first. @param {string} liner */
  async function capturesOf(liner) {
    const ofKind = kind === "wear" ? OF_WEAR : kind === "artificial-teat" ? [kind, REFERENCE] : [kind];
    const asked = [["measured", "true"], ["limit", String(MOST)], ["label", `liner=${liner}`], ...ofKind.map((test) => ["label", `test=${test}`])];
    const { captures } = await api.get(`/captures?${new URLSearchParams(asked)}`);
    return captures.filter((one) => one.state === "sealed");
  }

  /** @param {Capture} capture */
  function item(capture) {
    const box = el("input", { type: "checkbox", checked: chosen.has(capture.id), data: { capture: capture.id } });
    box.addEventListener("change", () => {
      if (box.checked) chosen.add(capture.id);
      else chosen.delete(capture.id);
      tell();
    });
    const { known_kpa, milkings, test } = capture.labels;
    const what = test === kind ? [t("tests.evaluate.kpa", { kpa: known_kpa ?? "–" })] : [t(`tests.kind.${test}`), milkings && t("tests.evaluate.milkings", { n: milkings })];
    return el("li", {}, el("label", { class: "check" }, box, el("span", {}, el("strong", {}, what.filter(Boolean).join(" · ")), " ", el("span", { class: "small muted" }, format.moment(capture.created_utc)))));
  }

  /** @param {boolean} now */
  function setBusy(now) {
    busy = now;
    tell();
  }

  function tell() {
    const few = offered.filter(({ id }) => chosen.has(id)).length < 2;
    evaluate.disabled = busy || few;
    setText(why, few ? t("tests.evaluate.few") : "");
  }

  async function submit() {
    if (busy) return;
    setBusy(true);
    try {
      const captures = offered.map(({ id }) => id).filter((id) => chosen.has(id));
      const queued = await api.post("/tests", { body: { kind, captures }, key });
      key = newKey();
      job.follow(queued);
    } catch (problem) {
      if (statusOf(problem)) key = newKey();
      context.refused(problem);
      setBusy(false);
    }
  }

  return {
    element, show,
    unmount() {
      turn = NaN;
      job.unmount();
    },
  };
}
