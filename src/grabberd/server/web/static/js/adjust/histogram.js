// A view's histogram: how many pixels have each grey value, and where the threshold lies.
import { el } from "../core/dom.js";

const SIZE = { width: 512, height: 120 };

/** @param {string} label */
export function createHistogram(label) {
  const canvas = el("canvas", { class: "histogram", width: SIZE.width, height: SIZE.height, role: "img", "aria-label": label });

  /** Logarithmic: targets are few pixels among many. @param {number[]} counts @param {number} threshold */
  function draw(counts, threshold) {
    const to = canvas.getContext("2d");
    if (!to) return;
    const { color, borderTopColor, outlineColor } = getComputedStyle(canvas);
    const most = Math.log1p(Math.max(...counts, 1));
    to.clearRect(0, 0, SIZE.width, SIZE.height);
    for (const [level, count] of counts.entries()) {
      const height = (Math.log1p(count) / most) * (SIZE.height - 6);
      to.fillStyle = level > threshold ? color : borderTopColor;
      to.fillRect(2 * level, SIZE.height - height, 2, height);
    }
    to.fillStyle = outlineColor;
    to.fillRect(2 * threshold + 1, 0, 3, SIZE.height);
  }

  return { element: canvas, draw };
}
