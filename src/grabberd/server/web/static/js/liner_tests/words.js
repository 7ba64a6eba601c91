// A guided test in words.
import { el, symbol } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { CheckVerdict, LinerTestRow, Recipe, TestCheck, TestQuantity } from "types/documents" */

/** Level and symbol. @type {Record<CheckVerdict, [string, string]>} */
export const VERDICTS = { passed: ["good", "ok"], failed: ["bad", "bad"], "not certain": ["warn", "warn"], "not checked": ["idle", "unknown"] };

/** @param {string} verdict */
export const keyOf = (verdict) => verdict.replace(" ", "_");

/** @param {Context} context @param {CheckVerdict} verdict */
export function verdictBadge({ t }, verdict) {
  const [level, sign] = VERDICTS[verdict];
  return el("span", { class: `badge is-${level}`, data: { verdict } }, symbol(sign), t(`tests.verdict.${keyOf(verdict)}`));
}

/** @param {Context} context @param {Recipe["kind"]} kind */
export const kindIn = ({ t }, kind) => t(`tests.kind.${kind}`);

/** "12.4 ± 0.2 kPa", to the second digit of its σ. @param {Context} context @param {number | null | undefined} value @param {number | null | undefined} sigma @param {string} unit */
export function valueIn({ format }, value, sigma, unit) {
  if (value === null || value === undefined) return "–";
  const whole = Number.isInteger(value) ? 0 : 2;
  const digits = sigma ? Math.min(6, Math.max(0, 1 - Math.floor(Math.log10(sigma)))) : whole;
  const spread = sigma ? ` ± ${format.number(sigma, digits)}` : "";
  return `${format.number(value, digits)}${spread}${unit && unit !== "1" ? ` ${unit}` : ""}`;
}

/** A sentence of the instrument's, which begins as one. @param {string} said */
export const sentence = (said) => said.charAt(0).toUpperCase() + said.slice(1);

/** Name of a quantity; one that the page does not know by the instrument's own. @param {Context} context @param {TestQuantity} quantity */
export const quantityIn = ({ t, texts }, { name, title }) => (texts.has(`tests.quantity.${name}`) ? t(`tests.quantity.${name}`) : sentence(title));

/** Title of a check, likewise. @param {Context} context @param {TestCheck} check */
export const checkIn = ({ t, texts }, { name, title }) => (texts.has(`tests.check.${name}`) ? t(`tests.check.${name}`) : sentence(title));

/** @param {Context} context @param {TestQuantity[]} quantities @param {number} most */
export function quantitiesIn(context, quantities, most) {
  const found = quantities.filter(({ value }) => value !== null).slice(0, most);
  return found.map((one) => `${quantityIn(context, one)} ${valueIn(context, one.value, one.sigma, one.unit)}`).join(" · ");
}

/** Its address. @param {Pick<LinerTestRow, "id">} test */
export const addressOf = ({ id }) => `#test/${encodeURIComponent(id)}`;

/** @param {string} level @param {...import("types/elements").Child} body */
export function note(level, ...body) {
  const signs = /** @type {Record<string, string>} */ ({ good: "ok", warn: "warn", bad: "bad", busy: "wait", idle: "info" });
  return el("div", { class: `note is-${level}` }, symbol(signs[level]), el("div", { class: "grow" }, ...body));
}
