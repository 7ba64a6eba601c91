// What lies over a chart: the playhead, the marks, and the press that moves the playhead.
import { el, fill } from "../core/dom.js";

/**
 * @param {HTMLElement} chart the element of a chart
 * @param {(share: number) => void} press told where it was pressed, from 0 to 1
 */
export function createTimeLine(chart, press) {
  const cursor = el("div", { class: "replay-cursor" });
  const flags = el("div");
  const element = el("div", { class: "replay-over", "aria-hidden": "true" }, flags, cursor);
  let placed = false;

  const sizes = new ResizeObserver(() => (placed = false));
  sizes.observe(chart);
  element.addEventListener("pointerdown", (event) => {
    element.setPointerCapture(event.pointerId);
    tell(event);
  });
  element.addEventListener("pointermove", (event) => event.buttons && tell(event));

  /** @param {PointerEvent} event */
  function tell(event) {
    const { left, width } = element.getBoundingClientRect();
    press(Math.min(Math.max((event.clientX - left) / Math.max(1, width), 0), 1));
  }

  /** Lies exactly on the chart's drawing, whose axes have their own room. */
  function lie() {
    const drawing = chart.querySelector(".u-over");
    const outer = element.parentElement?.getBoundingClientRect();
    if (!drawing || !outer) return;
    const box = drawing.getBoundingClientRect();
    Object.assign(element.style, { left: `${box.left - outer.left}px`, top: `${box.top - outer.top}px`, width: `${box.width}px`, height: `${box.height}px` });
    placed = box.width > 0;
  }

  return {
    element,
    /** @param {number} share of the window, from 0 to 1 */
    stand(share) {
      if (!placed) lie();
      cursor.hidden = share < 0 || share > 1;
      cursor.style.left = `${100 * share}%`;
    },
    /** @param {{share: number, name: string}[]} marks */
    mark(marks) {
      fill(flags, ...marks.map(({ share, name }) => {
        const flag = el("div", { class: "replay-flag" }, el("span", {}, name));
        flag.style.left = `${100 * share}%`;
        return flag;
      }));
    },
    /** The chart was drawn anew: its axes may need other room. */
    moved: () => (placed = false),
    end: () => sizes.disconnect(),
  };
}
