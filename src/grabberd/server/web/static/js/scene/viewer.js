// One object in space: picture, legend, words, and what can be chosen of them.
import { el, setText } from "../core/dom.js";
import { keep, kept } from "../core/kept.js";
import { createCanvas } from "./canvas.js";
import { css } from "./colours.js";
import { createControls } from "./controls.js";
import { createInspector } from "./inspector.js";
import { createLegend } from "./legend.js";
import { ballRound, fitted, VIEWS } from "./orbit.js";
import { pictureOf, save } from "./picture.js";
import { PLAIN, QUANTITIES, scaleOf, sharesOf } from "./quantities.js";
import { together } from "./scale.js";
import { canDraw } from "./stage.js";

/** @import { Context } from "../core/context.js" */
/** @import { Look, Parts } from "./controls.js" */
/** @import { Moment } from "./moments.js" */
/** @import { Frustum } from "./frustum.js" */
/** @import { Grid } from "./grid.js" */
/** @import { Orbit } from "./orbit.js" */
/** @import { Scale } from "./scale.js" */

const KEPT = "shape.look";
const PARTS = { points: true, wire: true, surface: true, cameras: false };
const SUMMARY_ID = "scene-summary";

/**
 * @typedef {object} Subject
 * @property {Grid} grid
 * @property {Frustum[]} frusta
 * @property {string[]} quantities that there are values of
 * @property {(moment: Moment) => string} when a moment in words
 * @property {string} file what a picture is called
 * @property {(quantity: string) => Scale | null} [scaleOf] the scale of a quantity of which all values are known
 * @property {(target: number | null) => void} [chosen] told of the target that is touched or chosen
 * @property {boolean} [compact] the controls are folded up below the drawing
 */

/** @param {Context} context @param {Subject} subject */
export function createViewer(context, subject) {
  if (!canDraw()) return unable(context, subject);
  const { t, format } = context;
  const { grid, frusta, quantities } = subject;
  const known = lookFrom(kept(KEPT));
  const look = {
    parts: { ...PARTS, ...known.parts },
    quantity: [PLAIN, ...quantities].find((one) => one === known.quantity) ?? quantities[0] ?? PLAIN,
  };
  /** One of the named views, which fill the picture by themselves; null: as it was turned. @type {string | null} */
  let view = "oblique";
  let orbit = VIEWS.oblique;
  /** @type {Moment | null} */
  let moment = null;
  /** @type {Scale | null} */
  let scale = null;
  /** @type {number | null} */
  let target = null;

  const words = {
    label: t("shape.label"), lost: t("shape.lost"), describedBy: SUMMARY_ID,
    nameOf: (/** @type {string} */ view) => t(`shape.camera.${view}`),
  };
  const canvas = createCanvas(grid, words, { turn, resized: () => draw(), tap: inspect });
  const legend = createLegend(format.number);
  const summary = el("p", { class: "small muted", id: SUMMARY_ID });
  const controls = createControls(context, look, quantities, {
    parts: (parts) => choose({ parts }),
    quantity: (quantity) => choose({ quantity }),
    view: see,
    turn,
    picture: takePicture,
  });
  const inspector = createInspector(context, grid, quantities, inspect);
  const figure = el("div", { class: "scene-figure" }, canvas.element, legend.element, summary);
  const side = [controls.element, inspector.element];
  const element = el("div", { class: `scene ${subject.compact ? "is-compact" : ""}` }, figure, subject.compact ? el("details", { class: "scene-more" }, el("summary", { class: "capture-summary" }, t("shape.more")), el("div", { class: "stack" }, side)) : el("div", { class: "stack" }, side));

  /** @param {(orbit: Orbit) => Orbit} change */
  function turn(change) {
    view = null;
    orbit = change(orbit);
    draw();
  }

  /** @param {string} name */
  function see(name) {
    view = name;
    draw();
  }

  /** @param {number | null} chosen */
  function inspect(chosen) {
    target = chosen;
    subject.chosen?.(target);
    draw();
  }

  /** Place of the chosen target. @param {Moment} now */
  function marked(now) {
    const i = target === null ? -1 : grid.index.get(target) ?? -1;
    return i >= 0 && Number.isFinite(now.xyz_mm[3 * i]) ? now.xyz_mm.subarray(3 * i, 3 * i + 3) : null;
  }

  /** @param {Partial<Look>} change */
  function choose(change) {
    Object.assign(look, change);
    keep(KEPT, { parts: look.parts, quantity: look.quantity });
    scale = null;
    if (moment) show(moment);
  }

  /** @param {Moment} now */
  function show(now) {
    moment = now;
    scale = subject.scaleOf?.(look.quantity) ?? together(scale, scaleOf(look.quantity, [now]));
    draw();
  }

  function draw() {
    if (!moment) return;
    const cameras = look.parts.cameras ? frusta : [];
    const places = [...grid.nominal_mm, ...cameras.flatMap((frustum) => frustum.apex_mm)];
    const object = ballRound(places);
    if (view) orbit = fitted(VIEWS[view], places, object, canvas.aspect());
    canvas.show({
      xyz_mm: moment.xyz_mm, shares: sharesOf(look.quantity, scale, moment), map: scale?.map ?? "rising",
      parts: look.parts, frusta: cameras, orbit, object, marked_mm: marked(moment),
    });
    controls.mark(view);
    inspector.show(target, moment);
    legend.show(coloured(), scale);
    setText(summary, describe(moment));
  }

  /** Quantity and unit. */
  const coloured = () => (look.quantity === PLAIN ? "" : t("shape.legend", { quantity: t(`shape.quantity.${look.quantity}`), unit: QUANTITIES[look.quantity].unit }));

  /** @param {Moment} now */
  function describe(now) {
    const parts = [t("shape.summary", { seen: now.seen, all: grid.target.length, name: grid.name }), `${subject.when(now)}.`, t(`shape.seen.${view ?? "own"}`)];
    if (scale) parts.push(t("shape.range", { quantity: coloured(), low: format.number(scale.low, 2), high: format.number(scale.high, 2) }));
    return parts.filter(Boolean).join(" ");
  }

  async function takePicture() {
    if (!moment) return;
    const colours = canvas.now();
    if (!colours) return;
    const caption = {
      words: `${t("shape.summary", { seen: moment.seen, all: grid.target.length, name: grid.name })} ${subject.when(moment)}`,
      legend: coloured(), scale, number: format.number, colours: { ground: css(colours.ground), ink: css(colours.ink) },
    };
    const blob = await pictureOf(canvas.canvas, caption);
    if (blob) save(blob, `${subject.file}-${moment.n ?? "phase"}.png`);
  }

  /** The drawing as it is now, and its legend; null where nothing is drawn. */
  const picture = () => (canvas.now() ? { canvas: canvas.canvas, legend: coloured(), scale } : null);
  return { element, show, picture, end: canvas.end };
}

/** An earlier look as it was kept. @param {unknown} kept @returns {{parts?: Partial<Parts>, quantity?: string}} */
function lookFrom(kept) {
  if (typeof kept !== "object" || kept === null) return {};
  const { parts, quantity } = /** @type {Record<string, unknown>} */ (kept);
  const known = Object.entries(typeof parts === "object" && parts !== null ? parts : {}).filter(([name, on]) => name in PARTS && typeof on === "boolean");
  return { parts: Object.fromEntries(known), quantity: typeof quantity === "string" ? quantity : undefined };
}

/** Stands in for the viewer where the browser cannot draw: a summary in words. @param {Context} context @param {Subject} subject */
function unable({ t }, subject) {
  const summary = el("p", { id: SUMMARY_ID });
  const note = el("div", { class: "note is-warn" }, el("p", {}, t("shape.noWebgl")));
  const element = el("div", { class: "stack" }, note, summary);
  /** @param {Moment} now */
  const show = (now) =>
    setText(summary, `${t("shape.summary", { seen: now.seen, all: subject.grid.target.length, name: subject.grid.name })} ${subject.when(now)}`);
  return { element, show, picture: () => null, end: () => {} };
}
