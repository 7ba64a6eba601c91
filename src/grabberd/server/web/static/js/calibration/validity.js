// Where a calibration is good: σ over both views and over depth, and what a movement of a view would cost.
import { el, fill } from "../core/dom.js";
import { colourAt, css } from "../scene/colours.js";
import { shareOf } from "../scene/scale.js";
import { coloursOf, onTheme } from "../scene/theme.js";
import { lengthsOf, scaleOf, spacing } from "./judge.js";

/** @import { Context } from "../core/context.js" */
/** @import { CalibrationValidity, ViewMovement, ViewValidity } from "types/documents" */
/** @import { Scale } from "../scene/scale.js" */

const HATCH_CSS_PX = 7;
/** @type {("point_mm" | "projection_px")[]} */
const QUANTITIES = ["point_mm", "projection_px"];
const AXES = /** @type {const} */ (["x", "y", "z"]);

/** @param {Context} context @param {CalibrationValidity} validity */
export function createValidity(context, validity) {
  const { t, format } = context;
  const scaleText = el("p", { class: "small number" });
  const strip = el("canvas", { class: "validity-scale", "aria-hidden": "true" });
  const depths = el("canvas", { class: "validity-depths", role: "img", "aria-label": t("calibration.validity.depths.drawn") });
  const pictures = validity.views.map((view) => ({ view, canvas: el("canvas", { class: "validity-picture", role: "img" }) }));
  const choice = el("select", { class: "input", id: "validity-quantity", on: { change: draw } }, QUANTITIES.map((one) => el("option", { value: one }, t(`calibration.validity.${one}`))));
  const element = el("section", { class: "card stack", "aria-labelledby": "validity-title" }, el("h2", { id: "validity-title" }, t("calibration.validity.title")),
    el("p", {}, t("calibration.validity.about")),
    el("div", { class: "field" }, el("label", { class: "field-label", for: "validity-quantity" }, t("calibration.validity.shown")), choice),
    el("div", { class: "target-views" }, pictures.map(({ view, canvas }) => el("figure", { class: "stack tight target-view" }, canvas, el("figcaption", { class: "small" }, t(`live.view.${view.view}`))))),
    strip, scaleText, el("h3", {}, t("calibration.validity.depths.title")), depths, table("depths", ["z", "sx", "sy", "sz", "where"], depthRows()), table("movements", ["what", "middle", "corner"], validity.movements.map(movementRow)));

  function draw() {
    const quantity = QUANTITIES[choice.selectedIndex] ?? QUANTITIES[0];
    const grids = validity.views.map((view) => lengthsOf(view[quantity]));
    const scale = scaleOf(validity.views, grids);
    const { surface, ink, ...lines } = coloursOf(element, { surface: "surface", ink: "ink", x: "plot-1", y: "plot-2", z: "plot-3" });
    const unit = quantity === "point_mm" ? "mm" : "px";
    const said = scale ? t("calibration.validity.scale", { low: format.number(scale.low, 3), high: format.number(scale.high, 3), unit }) : t("calibration.validity.nowhere");
    fill(scaleText, said);
    pictures.forEach(({ view, canvas }, i) => {
      canvas.setAttribute("aria-label", `${t(`live.view.${view.view}`)}: ${t(`calibration.validity.${quantity}`)}. ${said}`);
      paint(canvas, view, grids[i], scale, css(surface), css(ink));
    });
    ramp(strip);
    overDepth(depths, validity.depths, { x: css(lines.x), y: css(lines.y), z: css(lines.z) }, css(ink), css(surface), number);
  }

  /** A number as text, nought without a sign. @param {number | null | undefined} one @param {number} [digits] */
  function number(one, digits = 3) {
    return one === null || one === undefined ? "–" : format.number(Number(one.toFixed(digits)) || 0, digits);
  }

  function depthRows() {
    const { z_mm, inside, total } = validity.depths;
    return z_mm.map((z, i) => [number(z, 1), ...AXES.map((axis) => number(total[axis]?.[i])), inside[i] ? "" : t("calibration.validity.extrapolated")]);
  }

  /** @param {ViewMovement} one */
  function movementRow(one) {
    const amount = `${format.number(one.amount, 2)} ${one.unit === "deg" ? "°" : one.unit}`;
    const error = (/** @type {ViewMovement["middle_mm"]} */ by) => AXES.map((axis) => number(by[axis])).join(" / ");
    return [`${t(`live.view.${one.view}`)}: ${t(`calibration.validity.${one.movement}`, { amount })}`, error(one.middle_mm), error(one.corner_mm)];
  }

  /** @param {string} name @param {string[]} heads @param {string[][]} rows */
  function table(name, heads, rows) {
    const title = t(`calibration.validity.${name}.title`);
    const cell = (/** @type {string} */ text, /** @type {number} */ i) => (i ? el("td", { class: "number" }, text) : el("th", { scope: "row" }, text));
    return el("details", {}, el("summary", { class: "button" }, title), el("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": title },
      el("table", { class: "table" }, el("thead", {}, el("tr", {}, heads.map((one, i) => el("th", { scope: "col", class: i ? "number" : "" }, t(`calibration.validity.${name}.${one}`))))),
        el("tbody", {}, rows.map((row) => el("tr", {}, row.map(cell)))))));
  }

  const resized = new ResizeObserver(draw);
  for (const { view, canvas } of pictures) {
    canvas.style.aspectRatio = `${view.columns[view.columns.length - 1] - view.columns[0] + spacing(view.columns)} / ${view.lines[view.lines.length - 1] + spacing(view.lines)}`;
    resized.observe(canvas);
  }
  const themed = onTheme(draw);
  return {
    element,
    unmount() {
      resized.disconnect();
      themed();
    },
  };
}

/**
 * The nodes of a view as cells, hatched where σ is extrapolated; a place that a view does not see is left empty.
 * @param {HTMLCanvasElement} canvas
 * @param {ViewValidity} view
 * @param {number[][]} grid
 * @param {Scale | null} scale
 * @param {string} ground
 * @param {string} ink
 */
function paint(canvas, view, grid, scale, ground, ink) {
  const to = sized(canvas);
  if (!to) return;
  const [across, down] = [canvas.width / view.columns.length, canvas.height / view.lines.length];
  to.fillStyle = ground;
  to.fillRect(0, 0, canvas.width, canvas.height);
  grid.forEach((row, k) => row.forEach((value, i) => {
    const at = /** @type {const} */ ([i * across, k * down, across + 1, down + 1]);
    const share = scale ? shareOf(scale, value) : -1;
    if (share < 0) return;
    to.fillStyle = css(colourAt("rising", share));
    to.fillRect(...at);
  }));
  view.inside.forEach((row, k) => row.forEach((inside, i) => {
    if (!inside) hatch(to, i * across, k * down, across, down, ink, ground);
  }));
}

/**
 * σ of X, Y and Z over depth as lines from nought, hatched outside of the calibration frame's volume.
 * @param {HTMLCanvasElement} canvas
 * @param {CalibrationValidity["depths"]} depths
 * @param {Record<"x" | "y" | "z", string>} colours
 * @param {string} ink
 * @param {string} ground
 * @param {(one: number, digits?: number) => string} text
 */
function overDepth(canvas, { z_mm, inside, total }, colours, ink, ground, text) {
  const to = sized(canvas);
  const known = AXES.flatMap((axis) => total[axis] ?? []).filter((one) => one !== null);
  if (!to || !known.length) return;
  const unit = devicePixelRatio;
  const [left, bottom, top] = [56 * unit, canvas.height - 26 * unit, 10 * unit];
  const most = Math.max(...known) * 1.05;
  const across = (/** @type {number} */ z) => left + ((z - z_mm[0]) / (z_mm[z_mm.length - 1] - z_mm[0])) * (canvas.width - left - 30 * unit);
  const up = (/** @type {number} */ sigma) => bottom - (sigma / most) * (bottom - top);
  const [first, last] = [inside.indexOf(true), inside.lastIndexOf(true)].map((one) => across(z_mm[Math.max(one, 0)]));
  hatch(to, left, top, first - left, bottom - top, ink, ground);
  hatch(to, last, top, across(z_mm[z_mm.length - 1]) - last, bottom - top, ink, ground);
  to.font = `${13 * unit}px system-ui, sans-serif`;
  to.lineWidth = 3 * unit;
  for (const axis of AXES) {
    to.strokeStyle = to.fillStyle = colours[axis];
    to.beginPath();
    (total[axis] ?? []).forEach((one, i) => one !== null && to.lineTo(across(z_mm[i]), up(one)));
    to.stroke();
    const end = (total[axis] ?? []).findLast((one) => one !== null);
    if (typeof end === "number") to.fillText(axis.toUpperCase(), canvas.width - 22 * unit + AXES.indexOf(axis) * 6 * unit, up(end) + 4 * unit);
  }
  to.fillStyle = ink;
  to.fillText(text(most), 4 * unit, top + 12 * unit);
  to.fillText(text(0), 4 * unit, bottom);
  to.fillText(`Z ${text(z_mm[0], 0)}`, left, canvas.height - 6 * unit);
  to.textAlign = "end";
  to.fillText(`${text(z_mm[z_mm.length - 1], 0)} mm`, canvas.width - 30 * unit, canvas.height - 6 * unit);
}

/** @param {CanvasRenderingContext2D} to @param {number} left @param {number} top @param {number} width @param {number} height @param {string} ink @param {string} ground */
function hatch(to, left, top, width, height, ink, ground) {
  const step = HATCH_CSS_PX * devicePixelRatio;
  to.save();
  to.beginPath();
  to.rect(left, top, width, height);
  to.clip();
  // Dark and light side by side: one of them is seen on any colour.
  for (const [colour, aside] of /** @type {[string, number][]} */ ([[ground, devicePixelRatio], [ink, 0]])) {
    to.beginPath();
    for (let x = Math.floor((left + top) / step) * step; x < left + top + width + height; x += step) {
      to.moveTo(x - top + aside, top);
      to.lineTo(x - top - height + aside, top + height);
    }
    to.strokeStyle = colour;
    to.lineWidth = devicePixelRatio;
    to.stroke();
  }
  to.restore();
}

/** The colours from the least to the greatest. @param {HTMLCanvasElement} canvas */
function ramp(canvas) {
  const to = sized(canvas);
  if (!to) return;
  for (let x = 0; x < canvas.width; x++) {
    to.fillStyle = css(colourAt("rising", x / canvas.width));
    to.fillRect(x, 0, 1, canvas.height);
  }
}

/** @param {HTMLCanvasElement} canvas */
function sized(canvas) {
  const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((one) => Math.max(1, Math.round(one * devicePixelRatio)));
  Object.assign(canvas, { width, height });
  return canvas.getContext("2d");
}
