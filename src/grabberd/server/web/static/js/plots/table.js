// The numbers behind the charts: a table for readers who cannot see them, a file with all of them.
import { el, fill, symbol } from "../core/dom.js";
import { save } from "../scene/picture.js";
import { csvOf, summaryOf } from "./series.js";

/** @import { Context } from "../core/context.js" */
/** @import { Column } from "./series.js" */

/**
 * @typedef {object} Row
 * @property {string} name
 * @property {string} unit
 * @property {number} digits
 * @property {Column} column
 */

/**
 * @param {Context} context
 * @param {() => Row[]} rows of the table
 * @param {() => {name: string, names: string[], columns: Column[]}} file
 */
export function createTable({ t, format }, rows, file) {
  const body = el("tbody");
  const heads = ["what", "last", "mean", "least", "greatest"].map((name) => el("th", { scope: "col", class: name === "what" ? "" : "number" }, t(`plots.table.${name}`)));
  const table = el("table", { class: "table" }, el("thead", {}, el("tr", {}, heads)), body);
  const details = el("details", { class: "card", on: { toggle: () => details.open && show() } }, el("summary", { class: "plots-summary" }, t("plots.asTable")), el("div", { class: "scroll" }, table));
  const button = el("button", { class: "button", type: "button", data: { do: "csv" }, on: { click: download } }, symbol("download"), t("plots.csv"));

  /** @param {Row} row */
  function line({ name, unit, digits, column }) {
    const summary = summaryOf(column);
    const cell = (/** @type {number | undefined} */ value) => el("td", { class: "number" }, format.number(value, digits));
    return el("tr", {}, el("th", { scope: "row" }, unit ? `${name}, ${unit}` : name), cell(summary?.last), cell(summary?.mean), cell(summary?.least), cell(summary?.greatest));
  }

  function show() {
    if (details.open) fill(body, ...rows().map(line));
  }

  function download() {
    const { name, names, columns } = file();
    save(new Blob([csvOf(names, columns)], { type: "text/csv" }), name);
  }
  return { element: details, button, show };
}
