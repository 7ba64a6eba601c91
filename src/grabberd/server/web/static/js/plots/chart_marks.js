// What stands in a chart at certain places of its x: the playhead, and named marks.
import { el, fill } from "../core/dom.js";

/** @import uPlot from "../../vendor/uplot/uPlot.esm.js" */
/** @typedef {{x: number, name: string}} Flag */

export function createMarks() {
  const playhead = el("div", { class: "chart-mark", hidden: true });
  const flags = el("div", {});
  /** @type {Flag[]} */
  let shown = [];

  /** @param {HTMLElement} element @param {uPlot} plot @param {number | null} x */
  function stand(element, plot, x) {
    const left = x === null ? NaN : plot.valToPos(x, "x");
    element.hidden = !(left >= 0 && left <= plot.over.clientWidth);
    element.style.insetInlineStart = `${left}px`;
  }

  return {
    elements: [flags, playhead],
    /** @param {uPlot} plot @param {number | null} mark the playhead's place */
    place(plot, mark) {
      stand(playhead, plot, mark);
      shown.forEach(({ x }, i) => stand(/** @type {HTMLElement} */ (flags.children[i]), plot, x));
    },
    /** @param {Flag[]} now */
    flag(now) {
      shown = now;
      fill(flags, ...now.map(({ name }) => el("div", { class: "chart-flag" }, el("span", {}, name))));
    },
  };
}
