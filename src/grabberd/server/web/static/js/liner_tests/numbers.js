// The numbers that a recipe asks for, with buttons for who wears gloves.
import { el } from "../core/dom.js";
import { numberOf } from "../core/number.js";
import { createNumberField } from "../core/number_field.js";
import { keepWish } from "./liner.js";
import { NUMBERS } from "./wish.js";

/** @import { Context } from "../core/context.js" */
/** @import { Recipe } from "types/documents" */
/** @import { Asked, Wish } from "./wish.js" */

/** @param {Context} context @param {Recipe["kind"]} kind @param {Wish} wish which is changed @param {() => void} changed */
export function createNumbers(context, kind, wish, changed) {
  const { t } = context;

  /** @param {Asked} asked */
  function field({ name, unit, needed, step }) {
    const id = `test-${name}`;
    const attributes = { class: "input number", id, value: wish.numbers[name] ?? "", "aria-describedby": `${id}-about` };
    const { input, problem, judge } = createNumberField(context, attributes, (_, typed) => set(name, typed), () => ({ least: 0 }));
    const label = el("label", { class: "field-label", for: id }, t(`tests.number.${name}.label`), unit && el("span", { class: "muted" }, ` ${unit}`), !needed && el("span", { class: "muted" }, ` · ${t("analysis.optional")}`));
    const less = stepper(-step, "−", t("operate.length.less"));
    const more = stepper(step, "+", t("operate.length.more"));
    /** @param {number} by @param {string} sign @param {string} words */
    function stepper(by, sign, words) {
      const press = () => {
        const now = numberOf(input.value);
        const next = Math.max(0, (now && Number.isFinite(now) ? now : 0) + by);
        input.value = String(Math.round(next * 1000) / 1000);
        judge();
        set(name, input.value);
      };
      return el("button", { class: "button", type: "button", "aria-label": `${t(`tests.number.${name}.label`)}: ${words}`, on: { click: press } }, sign);
    }
    return el("div", { class: "field" }, label, el("div", { class: "stepper" }, less, input, more), problem, el("p", { class: "field-hint", id: `${id}-about` }, t(`tests.number.${name}.about`)));
  }

  /** @param {string} name @param {string} value */
  function set(name, value) {
    wish.numbers[name] = value;
    keepWish(wish);
    changed();
  }

  const asked = NUMBERS[kind];
  return el("div", { class: "tests-numbers", hidden: !asked.length }, asked.map(field));
}
