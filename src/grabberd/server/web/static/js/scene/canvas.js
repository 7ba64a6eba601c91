// The picture itself: canvas, words over it, and drawing it again when something has changed.
import { el } from "../core/dom.js";
import { createLabels } from "./labels.js";
import { listenToPointers } from "./pointer.js";
import { createStage } from "./stage.js";
import { coloursOf, onTheme } from "./theme.js";

/** @import { Rgb } from "./colours.js" */
/** @import { Grid } from "./grid.js" */
/** @import { Orbit } from "./orbit.js" */
/** @import { Shown } from "./stage.js" */

/** Greatest distance of a touch from the target it means, in CSS pixels. */
const NEAR_PIXELS = 28;
/** The stage's colours by the names that the style sheet has for them. */
const COLOURS = { ink: "ink", wire: "scene-wire", wireOn: "scene-wire-on", plain: "scene-plain", unknown: "scene-unknown", camera: "scene-camera", rim: "scene-rim", ground: "surface" };

/** @typedef {Omit<Shown, "colours">} View */

/**
 * @param {Grid} grid
 * @param {{label: string, lost: string, nameOf: (view: string) => string, describedBy: string}} words
 * @param {{turn: (change: (orbit: Orbit) => Orbit) => void, resized: () => void, tap: (target: number | null) => void}} on
 */
export function createCanvas(grid, words, on) {
  const canvas = el("canvas", { class: "scene-canvas", tabindex: 0, role: "img", "aria-label": words.label, "aria-describedby": words.describedBy });
  const labels = createLabels(words.nameOf);
  const veil = el("div", { class: "veil", hidden: true }, words.lost);
  const element = el("div", { class: "scene-picture veiled" }, canvas, labels.element, veil);
  let stage = createStage(canvas, grid);
  /** @type {View | null} */
  let shown = null;
  /** @type {Record<keyof typeof COLOURS, Rgb> | null} */
  let colours = null;
  let asked = 0;

  function paint() {
    asked = 0;
    if (!shown || !veil.hidden) return;
    colours ??= coloursOf(element, COLOURS);
    const all = { ...shown, colours };
    stage.draw(all);
    labels.place(stage, all);
  }

  /** The target that is nearest to a place on the canvas; null where none is near. @param {number} x @param {number} y */
  function targetAt(x, y) {
    let [nearest, least] = [/** @type {number | null} */ (null), NEAR_PIXELS];
    if (!shown) return null;
    for (const [i, id] of grid.target.entries()) {
      if (!Number.isFinite(shown.xyz_mm[3 * i])) continue;
      const at = stage.onCanvas(shown.xyz_mm.subarray(3 * i, 3 * i + 3));
      const apart = at ? Math.hypot(at.x - x, at.y - y) : Infinity;
      if (apart < least) [nearest, least] = [id, apart];
    }
    return nearest;
  }

  /** At the next picture of the screen, once. */
  function ask() {
    if (!asked) asked = requestAnimationFrame(paint);
  }

  const sizes = new ResizeObserver(([entry]) => {
    stage.resize(entry.contentRect.width, entry.contentRect.height);
    on.resized();
  });
  sizes.observe(canvas.parentElement ?? canvas);
  const ends = [
    onTheme(() => {
      colours = null;
      ask();
    }),
    listenToPointers(canvas, on.turn, (x, y) => on.tap(targetAt(x, y))),
    () => sizes.disconnect(),
    () => cancelAnimationFrame(asked),
    () => stage.dispose(),
  ];
  canvas.addEventListener("webglcontextlost", (event) => {
    event.preventDefault();
    veil.hidden = false;
  });
  canvas.addEventListener("webglcontextrestored", () => {
    stage = createStage(canvas, grid);
    stage.resize(element.clientWidth, element.clientHeight);
    veil.hidden = true;
    ask();
  });

  return {
    element, canvas,
    /** Width by height. */
    aspect: () => (element.clientWidth || 1) / (element.clientHeight || 1),
    /** @param {View} now */
    show(now) {
      shown = now;
      ask();
    },
    /** Draws at once, so that the picture can be read; its colours, null where nothing can be drawn. */
    now() {
      paint();
      return colours;
    },
    end: () => ends.forEach((end) => end()),
  };
}
