// The live picture: the split image as the grabber gives it, with what was found in it.
import { el } from "../core/dom.js";
import { deviceOf } from "../core/store.js";
import { createFeed } from "./feed.js";
import { drawOverlay } from "./overlay.js";
import { drawPixels } from "./pixels.js";
import { createVeil } from "./veil.js";
import { WHOLE, partOf } from "./view.js";

/** @import { Context } from "../core/context.js" */
/** @import { Preview } from "./message.js" */
/** @import { Frame, View } from "./view.js" */
/** @import { Illumination } from "types/documents" */

/** @typedef {ReturnType<typeof createPicture>} Picture */
/** @typedef {{seen?: (preview: Preview) => void, lit?: (light: Illumination) => void, rate_hz?: number}} Told of every field that is shown, and of the light; rate_hz: as often at most */
/** @typedef {"ids" | "residuals" | "clipped" | "bits"} Choice */

/** @type {Frame} as long as no picture has come: PAL's */
const FRAME = { columns: 720, lines: 576 };
/** From so many pixels of the screen for one of the picture on, the pixels are shown as they are. */
const LARGE = 4;

/** @param {Context} context @param {Told} [told] */
export function createPicture(context, { seen = () => {}, lit, rate_hz } = {}) {
  const { t, store } = context;
  const pixels = document.createElement("canvas");
  const canvas = el("canvas", { class: "picture-canvas", width: FRAME.columns, height: FRAME.lines, role: "img", tabindex: 0, "aria-label": t("live.picture") });
  const veil = createVeil(context);
  const element = el("div", { class: "picture veiled" }, canvas, veil.element);
  /** @type {Record<Choice, boolean>} */
  const choices = { ids: false, residuals: false, clipped: false, bits: false };
  let frozen = false;
  let view = WHOLE;
  let frame = FRAME;
  let painting = 0;
  /** @type {Preview | null} */
  let shown = null;

  /** @param {Preview} preview */
  function take(preview) {
    veil.came(preview);
    if (frozen) return;
    shown = preview;
    if (preview.frame.columns) frame = preview.frame;
    if (preview.rows) drawPixels(pixels, preview, choices.clipped);
    draw();
    seen(preview);
  }

  function draw() {
    painting = 0;
    const to = canvas.getContext("2d");
    if (!to) return;
    const scale = fit() * view.zoom;
    to.setTransform(1, 0, 0, 1, 0, 0);
    to.fillStyle = "#000";
    to.fillRect(0, 0, canvas.width, canvas.height);
    if (!shown?.rows) return;
    const { columns, rows, x0, xStep, y0, yStep } = shown;
    to.setTransform(scale, 0, 0, scale, -view.x * scale, -view.y * scale);
    to.imageSmoothingEnabled = scale * xStep < LARGE;
    // The middle of the pixel (0, 0) is half a pixel from the picture's corner; a row is `yStep` lines high.
    to.drawImage(pixels, 0, 0, columns, rows, x0, y0 + 0.5 - yStep / 2, columns * xStep, rows * yStep);
    drawOverlay(to, shown, deviceOf(store.get())?.views ?? {}, choices, devicePixelRatio / scale);
  }

  /** At the next picture of the screen, once. */
  function soon() {
    painting ||= requestAnimationFrame(draw);
  }

  /** As many pixels as the screen has there; returns how many a frame pixel gets. */
  function fit() {
    const width = Math.max(1, Math.round(canvas.clientWidth * devicePixelRatio));
    const height = Math.round((width * frame.lines) / frame.columns);
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    return width / frame.columns;
  }

  function wanted() {
    const width_px = Math.max(1, Math.round(canvas.clientWidth * devicePixelRatio * view.zoom));
    return { picture: choices.bits ? /** @type {const} */ ("bits") : /** @type {const} */ ("grey"), part: partOf(view, frame), width_px, rate_hz, light: Boolean(lit) };
  }

  const feed = createFeed(context, wanted, take, lit);
  const resized = new ResizeObserver(() => {
    soon();
    feed.ask();
  });
  resized.observe(canvas);
  return {
    element, canvas,
    view: () => view,
    frame: () => frame,
    /** Shows a part of the frame. @param {View} wish */
    look(wish) {
      view = wish;
      soon();
      feed.ask();
    },
    /** @param {boolean} stop */
    freeze(stop) {
      frozen = stop;
      element.classList.toggle("frozen", stop);
      veil.hold(stop);
    },
    /** @param {Choice} name @param {boolean} on */
    choose(name, on) {
      choices[name] = on;
      if (name === "clipped" && shown?.rows) drawPixels(pixels, shown, on);
      soon();
      feed.ask();
    },
    unmount() {
      feed.unmount();
      veil.unmount();
      cancelAnimationFrame(painting);
      resized.disconnect();
    },
  };
}
