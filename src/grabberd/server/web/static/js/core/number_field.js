// A field for a number: what cannot be used is refused beside it, and neither rounded nor moved to a limit.
import { el, setText } from "./dom.js";
import { numberOf, problemOf } from "./number.js";

/** @import { Attributes } from "types/elements" */
/** @import { Context } from "./context.js" */
/** @import { Limits } from "./number.js" */

/**
 * The input, and what is wrong with its number, to be put beside it.
 * @param {Pick<Context, "t" | "format">} context
 * @param {Attributes & {id: string}} attributes of the input
 * @param {(value: number | null, typed: string) => void} given what was typed; null: nothing, NaN: it cannot be used
 * @param {() => Limits} [limits]
 */
export function createNumberField({ t, format }, attributes, given, limits = () => ({})) {
  const problem = el("span", { class: "field-problem", id: `${attributes.id}-problem`, role: "alert", hidden: true });
  const described = [attributes["aria-describedby"], problem.id].filter(Boolean).join(" ");
  const input = el("input", { type: "text", inputmode: "decimal", autocomplete: "off", ...attributes, "aria-describedby": described });
  input.addEventListener("input", () => given(judge() ? NaN : numberOf(input.value), input.value));

  /** @param {number | undefined} limit */
  const inWords = (limit) => format.number(limit, Number.isInteger(limit) ? 0 : 2);

  /** Name of what is wrong, which is said. */
  function judge() {
    const { least, most } = limits();
    const found = problemOf(input.value, limits());
    const words = found ? t(`core.number.${found}`, { typed: input.value.trim(), least: inWords(least), most: inWords(most) }) : "";
    setText(problem, words);
    problem.hidden = !found;
    input.setCustomValidity(words);
    input.setAttribute("aria-invalid", String(found !== null));
    return found;
  }

  judge();
  return {
    input, problem, judge,
    /** Shows a number unless one is being typed; NaN leaves what cannot be used. @param {number | null} value @param {string} [words] the number as shown */
    show(value, words = String(value ?? "")) {
      if (document.activeElement === input) return;
      if (!Number.isNaN(value)) input.value = words;
      judge();
    },
  };
}
