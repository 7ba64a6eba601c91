// Choice of a target: by its id, or the next one.
import { el, symbol } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { Grid } from "../scene/grid.js" */

/**
 * @param {Context} context
 * @param {Grid} grid
 * @param {number} first
 * @param {(target: number) => void} choose
 */
export function createTargetPicker({ t }, grid, first, choose) {
  /** @param {number} row */
  const ofRow = (row) => grid.target.map((_, i) => i).filter((i) => grid.row[i] === row).sort((a, b) => grid.column[a] - grid.column[b]);
  /** @param {number} i */
  const option = (i) => el("option", { value: grid.target[i] }, t("plots.target", { id: grid.target[i], column: grid.column[i] + 1 }));

  const rows = [...new Set(grid.row)].sort((a, b) => a - b);
  const groups = rows.map((row) => el("optgroup", { label: t("plots.row", { n: row + 1 }) }, ofRow(row).map((i) => option(i))));
  const select = el("select", { class: "input", id: "target", on: { change: () => choose(Number(select.value)) } }, groups);
  select.value = String(grid.index.has(first) ? first : middle(grid));

  /** @param {number} by */
  function step(by) {
    select.selectedIndex = Math.min(Math.max(select.selectedIndex + by, 0), select.options.length - 1);
    choose(Number(select.value));
  }
  const button = (/** @type {number} */ by, /** @type {string} */ name) =>
    el("button", { class: "button icon", type: "button", "aria-label": t(`plots.${name}`), title: t(`plots.${name}`), on: { click: () => step(by) } }, symbol(by < 0 ? "back" : "next"));
  const element = el(
    "div", { class: "field" },
    el("label", { class: "field-label", for: "target" }, t("plots.whichTarget")),
    el("div", { class: "row plots-picker" }, button(-1, "before"), select, button(1, "after")),
  );
  return {
    element,
    chosen: () => Number(select.value),
    /** Shows another as the chosen one. @param {number} target */
    choose: (target) => void (select.value = String(target)),
  };
}

/** The target in the middle: it moves most, and both cameras see it. @param {Grid} grid */
function middle(grid) {
  const half = (/** @type {number[]} */ all) => (Math.min(...all) + Math.max(...all)) / 2;
  const [row, column] = [half(grid.row), half(grid.column)];
  const apart = grid.target.map((_, i) => Math.hypot(grid.row[i] - row, grid.column[i] - column));
  return grid.target[apart.indexOf(Math.min(...apart))];
}
