// The legend of a chart: values with units under the cursor, and which lines are drawn.
import { el, setText } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { Line, Options } from "./chart.js" */

/**
 * @param {Context} context
 * @param {Options} options
 * @param {(line: number, isShown: boolean) => void} choose
 */
export function createLegend({ format }, options, choose) {
  const { lines, unit, digits } = options;
  const values = lines.map(() => el("span", { class: "number" }, "–"));
  const when = el("li", { class: "chart-when number muted", hidden: true });
  const element = el("ul", { class: "chart-legend" }, when, lines.map(item));
  const shown = lines.map(() => true);

  /** @param {Line} line @param {number} i */
  function item(line, i) {
    const words = [swatch(line), line.label, " ", el("b", {}, values[i])];
    if (lines.length < 2) return el("li", {}, words);
    const button = el("button", { class: "chart-line", type: "button", "aria-pressed": "true", data: { line: i }, on: { click: toggle } }, words);
    function toggle() {
      shown[i] = !shown[i];
      button.setAttribute("aria-pressed", String(shown[i]));
      choose(i, shown[i]);
    }
    return el("li", {}, button);
  }

  return {
    element,
    /** Which lines are drawn. */
    shown: () => [...shown],
    /**
     * @param {string} at the time in words; empty where it is now
     * @param {(number | null | undefined)[]} found a value of each line
     * @param {(number | null | undefined)[]} sigmas of them, as far as they are known
     */
    tell(at, found, sigmas) {
      when.hidden = !at;
      setText(when, at);
      values.forEach((one, i) => {
        const [value, sigma] = [found[i], sigmas[i]];
        const known = value !== null && value !== undefined;
        // To the digit in which σ begins, but no farther than makes sense to read.
        const places = known && sigma ? Math.min(Math.max(digits, -Math.floor(Math.log10(sigma))), digits + 2) : digits;
        const spread = known && sigma ? ` ± ${format.number(sigma, places)}` : "";
        setText(one, `${format.number(value, places)}${spread}${known && unit ? ` ${unit}` : ""}`);
      });
    },
  };
}

/** @param {Line} line */
export const swatch = (line) => el("span", { class: `chart-swatch plot-${line.ink} ${line.dash ? "is-dashed" : ""}`, "aria-hidden": "true" });
