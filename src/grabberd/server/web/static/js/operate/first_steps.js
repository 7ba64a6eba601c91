// The way to the first capture, on an instrument that has made none: picture, calibration, Start.
import { el, fill, symbol } from "../core/dom.js";
import { deviceOf } from "../core/store.js";
import { judge } from "../lights/judge.js";

/** @import { Context } from "../core/context.js" */
/** @import { Known } from "../core/store.js" */

/** @param {Context} context */
export function createFirstSteps(context) {
  const { t, store } = context;
  const steps = el("ol", { class: "first-steps" });
  const element = el("div", { class: "stack" }, el("h2", {}, t("operate.first.title")), steps);
  let shown = "";

  /** Unchanged steps are left alone: somebody may be about to press one. @param {Known} known */
  function show(known) {
    const done = doneIn(known);
    if (JSON.stringify(done) === shown) return;
    shown = JSON.stringify(done);
    fill(steps, step("picture", done.picture, "live"), step("calibration", done.calibration, "calibration"), step("capture", false, ""));
  }

  /** @param {"picture" | "calibration" | "capture"} name @param {boolean} done @param {string} route */
  function step(name, done, route) {
    const words = t(`operate.first.${name}.${done ? "done" : "todo"}`);
    const sign = done ? symbol("ok", t("operate.first.done")) : symbol("unknown", t("operate.first.open"));
    const open = route && el("a", { class: "button", href: `#${route}` }, t(`operate.first.${name}.open`));
    return el("li", { class: `first-step is-${done ? "good" : "idle"}`, data: { step: name, done: String(done) } }, sign, el("span", {}, words), open);
  }

  const stop = store.subscribe((known) => JSON.stringify(doneIn(known)), () => show(store.get()));
  show(store.get());
  return { element, unmount: stop };
}

/** What of it is done: both views show the object's targets, and what measures is a calibration that was chosen. @param {Known} known */
function doneIn(known) {
  const levels = Object.fromEntries(judge(known).map(({ id, level }) => [id, level]));
  const views = deviceOf(known)?.live?.views;
  const seen = Boolean(views && Math.min(...Object.values(views)) > 0);
  return { picture: levels.signal === "good" && seen, calibration: levels.calibration === "good" };
}
