// One chart: lines, a band of σ round one of them, a legend with the values under the cursor; zoomed, moved and read by
// touch, mouse and keys, together with its neighbours; taken home as a picture or a table.
import uPlot from "../../vendor/uplot/uPlot.esm.js";
import { el } from "../core/dom.js";
import { onTheme } from "../scene/theme.js";
import { createButtons } from "./chart_buttons.js";
import { gesturesOf } from "./chart_gestures.js";
import { createLegend } from "./chart_legend.js";
import { createMarks } from "./chart_marks.js";
import { aligned, coloursAt, drawingOf } from "./drawing.js";
import { listenToGestures } from "./gestures.js";
import { createLink, linkOf } from "./link.js";
import { partOf } from "./range.js";

/** @import { Context } from "../core/context.js" */
/** @import { Ink } from "./drawing.js" */
/** @import { Shared } from "./link.js" */
/** @import { Range } from "./range.js" */
/** @import { Column } from "./series.js" */

export { INKS } from "./drawing.js";

/**
 * @typedef {object} Line
 * @property {string} label
 * @property {Ink} ink one of the plots' colours
 * @property {number[]} [dash]
 * @property {string} [column] its name in the table, with the unit; made of label and unit by default
 */

/**
 * @typedef {object} Options
 * @property {string} title
 * @property {string} unit
 * @property {number} digits after the point
 * @property {Line[]} lines
 * @property {boolean} [band] the last two columns are the band round the first line
 * @property {(x: number) => string} when a time in words
 * @property {{name: string, label: string}} [x] its column in the table, its words on paper
 * @property {string} [together] charts of this name have one cursor, one range and one playhead: see link.js
 * @property {(range: Range | null) => void} [zoomed] null: all of it
 * @property {(x: number) => void} [pressed] it was tapped there
 * @property {boolean} [joined] lines go on over what is missing: each has values at places of its own
 * @property {[number, number]} [least] the least range of values
 * @property {[number, number]} [over] the range of times; all of them by default
 * @property {number} [height] of the drawing, in pixels
 * @property {string} [file] begin of a file's name; without it the chart is not taken home
 */

const HEIGHT = 190;
const TOLD_MS = 250;
/** No closer than so many samples. */
const FEWEST = 4;

/** @param {Context} context @param {Options} options */
export function createChart(context, options) {
  const { t, format } = context;
  const link = options.together ? linkOf(options.together) : createLink();
  const legend = createLegend(context, options, choose);
  const place = el("div", { class: "chart-place", role: "img", tabindex: 0, "aria-label": options.title, "aria-description": t("plots.keys") });
  const marks = createMarks();
  const heading = el("h2", {}, options.title, options.unit ? el("span", { class: "muted" }, ` ${options.unit}`) : null);
  const height = options.height ?? HEIGHT;
  const state = () => ({ columns: data, sigmas: options.lines.map((_, i) => sigmaOf(i)), shown: legend.shown(), range: link.get().range });
  const buttons = createButtons(context, options, () => zoom(null), state);
  const element = el("section", { class: "card chart" }, el("div", { class: "chart-head" }, heading, legend.element), place, buttons.element);
  /** @type {Column[]} */
  let data = [[], ...options.lines.map(() => []), ...(options.band ? [[], []] : [])];
  /** @type {Column[]} */
  let sigmas = [];
  /** @type {uPlot | null} */
  let plot = null;
  let following = false;
  let timer = 0;

  function build() {
    const width = place.clientWidth;
    if (!width) return;
    plot?.destroy();
    const drawing = drawingOf(options, format, coloursAt(element), { width, height, range: () => link.get().range });
    plot = new uPlot({ ...drawing, hooks: { setCursor: [point], ready: [(one) => one.over.append(...marks.elements)], draw: [showMark] } }, aligned(data), place);
    legend.shown().forEach((isShown, i) => isShown || choose(i, false));
    tell();
  }

  /** @param {number} line @param {boolean} isShown */
  function choose(line, isShown) {
    plot?.setSeries(line + 1, { show: isShown });
    if (options.band && line === 0) for (const edge of [1, 2]) plot?.setSeries(options.lines.length + edge, { show: isShown });
  }

  /** @param {uPlot} now whose cursor has been moved */
  function point(now) {
    if (following) return;
    const at = now.cursor.idx;
    link.set({ cursor: at === null || at === undefined ? null : data[0][at] });
  }

  /** σ of a line as given, or as the band shows it. @param {number} line @returns {Column} */
  function sigmaOf(line) {
    if (sigmas[line] || line > 0 || !options.band) return sigmas[line] ?? [];
    return data[1].map((value, i) => (value === null ? null : Math.abs(/** @type {number} */ (data[options.lines.length + 1][i] ?? value) - value)));
  }

  /** The values under the cursor, or at the playhead, or the last. */
  function tell() {
    const { cursor, mark } = link.get();
    const at = cursor ?? mark;
    const index = at === null || !plot ? data[0].length - 1 : plot.valToIdx(at);
    const x = data[0][index];
    legend.tell(at === null || x === null || x === undefined ? "" : options.when(x), options.lines.map((_, i) => data[i + 1][index]), options.lines.map((_, i) => sigmaOf(i)[index]));
  }

  /** @param {Shared} now @param {Shared} before */
  function follow(now, before) {
    if (now.range !== before.range) {
      buttons.tell(now.range === null);
      const [min, max] = now.range ?? whole();
      plot?.setScale("x", { min, max });
      clearTimeout(timer);
      timer = setTimeout(() => options.zoomed?.(now.range), TOLD_MS);
    }
    if (now.cursor !== before.cursor && plot) {
      following = true;
      const left = now.cursor === null ? -10 : plot.valToPos(now.cursor, "x");
      plot.setCursor({ left, top: left < 0 ? -10 : 0 });
      following = false;
    }
    if (now.mark !== before.mark) showMark();
    tell();
  }

  function showMark() {
    if (plot) marks.place(plot, link.get().mark);
  }

  /** @returns {Range} */
  const whole = () => options.over ?? [data[0][0] ?? 0, data[0].at(-1) ?? 1];
  const shown = () => link.get().range ?? whole();

  /** Shows a part, or all of it, here and in the charts beside it. @param {Range | null} wanted */
  function zoom(wanted) {
    const [low, high] = whole();
    const least = ((high - low) * FEWEST) / Math.max(FEWEST, data[0].length - 1);
    const range = wanted && partOf([low, high], wanted, least);
    if (range !== link.get().range) link.set({ range });
  }

  const endGestures = listenToGestures(place, () => plot?.over.getBoundingClientRect() ?? null, gesturesOf({
    link, shown, zoom,
    plot: () => plot,
    places: () => data[0],
    pressed: (x) => options.pressed?.(x),
  }));

  const sizes = new ResizeObserver(([entry]) => {
    if (!plot) build();
    else if (Math.abs(plot.width - entry.contentRect.width) > 1 && entry.contentRect.width) plot.setSize({ width: entry.contentRect.width, height });
  });
  sizes.observe(place);
  const endTheme = onTheme(build);
  const endLink = link.watch(follow);

  return {
    element,
    zoom,
    /** Names places of its x. @param {import("./chart_marks.js").Flag[]} flags */
    flag(flags) {
      marks.flag(flags);
      showMark();
    },
    /** @param {Column[]} columns times first @param {string} words what they show @param {Column[]} [spread] σ of each line, where they are known */
    set(columns, words, spread = []) {
      data = columns;
      sigmas = spread;
      place.setAttribute("aria-label", words);
      if (plot) plot.setData(aligned(columns));
      else build();
      tell();
    },
    end() {
      clearTimeout(timer);
      sizes.disconnect();
      endTheme();
      endGestures();
      endLink();
      plot?.destroy();
    },
  };
}
