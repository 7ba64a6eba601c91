// Controls of the drawing: its layers, its colours, its viewpoint.
import { el, symbol } from "../core/dom.js";
import { turned, VIEWS, zoomed } from "./orbit.js";
import { PLAIN } from "./quantities.js";

/** @import { Context } from "../core/context.js" */
/** @import { Orbit } from "./orbit.js" */

/** @typedef {"points" | "wire" | "surface" | "cameras"} Part */
/** @type {Part[]} */
export const PARTS = ["points", "wire", "surface", "cameras"];
const TURN_DEG = 15;
const ZOOM = 1.25;

/** @typedef {Record<Part, boolean>} Parts */

/**
 * @typedef {object} Look
 * @property {Parts} parts
 * @property {string} quantity
 */

/**
 * @param {Context} context
 * @param {Look} look
 * @param {string[]} quantities that there are values of
 * @param {{parts: (parts: Parts) => void, quantity: (name: string) => void, view: (name: string) => void, turn: (change: (orbit: Orbit) => Orbit) => void, picture: () => void}} on
 */
export function createControls({ t }, look, quantities, on) {
  const parts = { ...look.parts };
  const views = Object.keys(VIEWS).map((name) =>
    el("button", { class: "button", type: "button", data: { view: name }, on: { click: () => on.view(name) } }, t(`shape.view.${name}`)),
  );

  /** @param {Part} name */
  function part(name) {
    const box = el("input", { type: "checkbox", checked: parts[name], data: { part: name } });
    box.addEventListener("change", () => {
      parts[name] = box.checked;
      on.parts({ ...parts });
    });
    return el("label", { class: "check" }, box, t(`shape.part.${name}`));
  }

  function colours() {
    const options = [PLAIN, ...quantities].map((name) => el("option", { value: name, selected: name === look.quantity }, t(`shape.quantity.${name}`)));
    const select = el("select", { class: "input", id: "shape-quantity", on: { change: () => on.quantity(select.value) } }, options);
    return el("div", { class: "field" }, el("label", { class: "field-label", for: "shape-quantity" }, t("shape.colouredBy")), select);
  }

  /** @param {string} name @param {string | Node} sign @param {(orbit: Orbit) => Orbit} change */
  const step = (name, sign, change) =>
    el("button", { class: "button icon", type: "button", "aria-label": t(`shape.step.${name}`), title: t(`shape.step.${name}`), on: { click: () => on.turn(change) } }, sign);

  const steps = [
    step("left", "←", (orbit) => turned(orbit, -TURN_DEG, 0)),
    step("right", "→", (orbit) => turned(orbit, TURN_DEG, 0)),
    step("up", "↑", (orbit) => turned(orbit, 0, TURN_DEG)),
    step("down", "↓", (orbit) => turned(orbit, 0, -TURN_DEG)),
    step("nearer", "+", (orbit) => zoomed(orbit, ZOOM)),
    step("farther", "−", (orbit) => zoomed(orbit, 1 / ZOOM)),
  ];
  const picture = el("button", { class: "button", type: "button", data: { do: "picture" }, on: { click: on.picture } }, symbol("download"), t("shape.picture"));
  const element = el(
    "div", { class: "scene-controls" },
    el("fieldset", { class: "field" }, el("legend", { class: "field-label" }, t("shape.seenFrom")), el("div", { class: "scene-views" }, views)),
    el("fieldset", { class: "field" }, el("legend", { class: "field-label" }, t("shape.turn")), el("div", { class: "scene-steps" }, steps)),
    el("fieldset", { class: "field" }, el("legend", { class: "field-label" }, t("shape.shown")), el("div", { class: "scene-parts" }, PARTS.map(part))),
    el("div", { class: "stack" }, colours(), picture),
  );

  /** Marks the button of a view. @param {string | null} view */
  function mark(view) {
    for (const button of views) button.setAttribute("aria-pressed", String(button.dataset.view === view));
  }
  return { element, mark };
}
