// One target in numbers: chosen from the list, or touched in the picture.
import { el, fill } from "../core/dom.js";
import { QUANTITIES } from "./quantities.js";

/** @import { Context } from "../core/context.js" */
/** @import { Moment } from "./moments.js" */
/** @import { Grid } from "./grid.js" */

const AXES = ["X", "Y", "Z"];

/**
 * @param {Context} context
 * @param {Grid} grid
 * @param {string[]} quantities
 * @param {(target: number | null) => void} choose
 */
export function createInspector({ t, format }, grid, quantities, choose) {
  const options = grid.target.map((id) => el("option", { value: id }, String(id)));
  const chosen = () => choose(select.value ? Number(select.value) : null);
  const select = el("select", { class: "input", id: "scene-target", on: { change: chosen } }, el("option", { value: "" }, t("shape.noTarget")), options);
  const facts = el("dl", { class: "facts number" });
  const element = el(
    "section", { class: "scene-inspector", "aria-label": t("shape.target") },
    el("div", { class: "field" }, el("label", { class: "field-label", for: "scene-target" }, t("shape.target")), select),
    facts,
  );

  /** @param {number | null} target @param {Moment} moment */
  function show(target, moment) {
    select.value = target === null ? "" : String(target);
    fill(facts, target === null ? null : factsOf(/** @type {number} */ (grid.index.get(target)), moment));
  }

  /** @param {number} i @param {Moment} moment */
  function factsOf(i, moment) {
    if (!Number.isFinite(moment.xyz_mm[3 * i])) return el("dt", {}, t("shape.notSeen"));
    const places = AXES.map((axis, k) => fact(axis, moment.xyz_mm[3 * i + k], 2, "mm"));
    return [...places, ...quantities.map((name) => fact(t(`shape.short.${name}`), moment.values[name]?.[i] * QUANTITIES[name].factor, 3, QUANTITIES[name].unit))];
  }

  /** @param {string} name @param {number} value @param {number} digits @param {string} unit */
  const fact = (name, value, digits, unit) => [el("dt", {}, name), el("dd", {}, `${format.number(value, digits)} ${unit}`)];

  return { element, show };
}
