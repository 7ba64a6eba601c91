// The steps of the guided calibration.
import { el, symbol } from "../core/dom.js";
import { keep, kept } from "../core/kept.js";

/** @import { Context } from "../core/context.js" */
/** @import { Child } from "types/elements" */

export const STEPS = ["place", "take", "found", "adjust", "review"];
const AT = "calibration.at";

/** Remembers the present step. @param {string} step @param {string} [id] */
export function remember(step, id) {
  keep(AT, id ? [step, id] : [step]);
}

/** The step where the guided calibration was left; null: none. @returns {{step: string, id?: string} | null} */
export function leftAt() {
  const at = kept(AT);
  if (!Array.isArray(at) || !STEPS.includes(at[0])) return null;
  return { step: at[0], id: typeof at[1] === "string" ? at[1] : undefined };
}

export function forget() {
  keep(AT, null);
}

/** @param {Context} context @param {string} step */
export function createSteps({ t }, step) {
  const at = STEPS.indexOf(step);
  const items = STEPS.map((name, i) => {
    const state = i < at ? "is-done" : i === at ? "is-now" : "";
    return el("li", { class: `step ${state}`, "aria-current": i === at ? "step" : null }, el("span", { class: "step-number" }, i < at ? symbol("ok") : String(i + 1)), el("span", {}, t(`calibration.steps.${name}`)));
  });
  return el("nav", { class: "steps-card", "aria-label": t("calibration.steps.label") }, el("ol", { class: "steps" }, items));
}

/** A note of a level. @param {string} level @param {...Child} body */
export function note(level, ...body) {
  const signs = /** @type {Record<string, string>} */ ({ good: "ok", warn: "warn", bad: "bad", busy: "wait", idle: "info" });
  return el("div", { class: `note is-${level}` }, symbol(signs[level]), el("div", { class: "grow" }, ...body));
}

/** A way to another step. @param {string} href @param {string} words @param {string} [kind] */
export function way(href, words, kind = "") {
  return el("a", { class: `button ${kind}`, href }, words);
}

/** @param {string} step @param {string} [id] */
export function addressOf(step, id) {
  return `#calibration/${step}${id ? `/${encodeURIComponent(id)}` : ""}`;
}
