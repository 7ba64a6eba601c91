// Legend of the colour scale.
import { el, fill } from "../core/dom.js";
import { colourAt, css } from "./colours.js";
import { digitsOf, shareOf, ticks } from "./scale.js";

/** @import { Scale } from "./scale.js" */

const STEPS = 32;

/** The colours of a map in even steps, as CSS. @param {"rising" | "signed"} map */
export const stepsOf = (map) => Array.from({ length: STEPS + 1 }, (_, i) => css(colourAt(map, i / STEPS)));

/**
 * The round values along a scale: where, from 0 to 1, and in words.
 * @param {Scale} scale
 * @param {(value: number, digits: number) => string} number
 */
export function marksOf(scale, number) {
  const marks = ticks(scale.low, scale.high, 5);
  const digits = digitsOf(marks);
  return marks.map((value) => ({ at: shareOf(scale, value), text: number(value, digits) }));
}

/** @param {(value: number, digits: number) => string} number */
export function createLegend(number) {
  const title = el("div", { class: "scene-legend-title" });
  const bar = el("div", { class: "scene-legend-bar" });
  const marks = el("div", { class: "scene-legend-marks number" });
  const element = el("div", { class: "scene-legend", "aria-hidden": "true", hidden: true }, title, bar, marks);

  let shown = "";

  /** @param {string} words quantity and unit @param {Scale | null} scale null: no colours */
  function show(words, scale) {
    const now = JSON.stringify([words, scale]);
    if (now === shown) return; // fifty times a second, while a capture is played
    shown = now;
    element.hidden = scale === null;
    if (!scale) return;
    fill(title, words);
    bar.style.background = `linear-gradient(to right, ${stepsOf(scale.map).join(", ")})`;
    fill(marks, ...marksOf(scale, number).map(mark));
  }
  return { element, show };
}

/** @param {{at: number, text: string}} mark */
function mark({ at, text }) {
  const made = el("span", {}, text);
  made.style.insetInlineStart = `${(at * 100).toFixed(2)}%`;
  return made;
}
