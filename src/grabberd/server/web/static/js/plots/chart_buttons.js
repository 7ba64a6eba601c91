// Buttons below a chart: all of it again, the picture, the table.
import { el, symbol } from "../core/dom.js";
import { save } from "../scene/picture.js";

/** @import { Context } from "../core/context.js" */
/** @import { Options } from "./chart.js" */
/** @import { Column } from "./series.js" */

/**
 * @param {Context} context
 * @param {Options} options
 * @param {() => void} reset
 * @param {() => {columns: Column[], sigmas: Column[], shown: boolean[], range: [number, number] | null}} state
 */
export function createButtons(context, options, reset, state) {
  const { t, format } = context;
  const whole = el("button", { class: "button", type: "button", hidden: true, data: { do: "reset" }, on: { click: reset } }, t("plots.reset"));
  const element = el("div", { class: "chart-buttons" }, whole, options.file && [button("png", picture), button("csv", table)]);

  /** @param {string} name @param {() => Promise<void>} take */
  function button(name, take) {
    return el("button", { class: "button", type: "button", data: { file: name }, "aria-label": `${name.toUpperCase()}: ${options.title}`, on: { click: () => take().catch(context.refused) } }, symbol("download"), name.toUpperCase());
  }

  async function picture() {
    const { pictureOf } = await import("./chart_files.js");
    const blob = await pictureOf(element, options, format, state());
    if (blob) save(blob, `${options.file}.png`);
  }

  async function table() {
    const { tableOf } = await import("./chart_files.js");
    const { columns, sigmas } = state();
    save(new Blob([tableOf(options, columns, sigmas)], { type: "text/csv" }), `${options.file}.csv`);
  }

  return {
    element,
    /** @param {boolean} isWhole */
    tell: (isWhole) => void (whole.hidden = isWhole),
  };
}
