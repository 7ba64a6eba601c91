// The live picture: the split image as the grabber gives it, with what was found in it.
import { el, setText } from "../core/dom.js";
import { deviceOf } from "../core/store.js";
import { drawBits } from "./bits.js";
import { createFeed } from "./feed.js";
import { drawOverlay } from "./overlay.js";

/** @import { Context } from "../core/context.js" */
/** @import { Preview } from "./message.js" */

const OLD_MS = 1000;
const LOOK_MS = 250;
const FRAME = { columns: 720, lines: 576 };

/** @param {Context} context @param {(preview: Preview) => void} [seen] told of every field that is shown */
export function createPicture(context, seen = () => {}) {
  const { t, store } = context;
  const bits = document.createElement("canvas");
  const canvas = el("canvas", { class: "picture-canvas", role: "img", "aria-label": t("live.picture") });
  const veil = el("p", { class: "veil", hidden: true });
  const scroll = el("div", { class: "picture-scroll", tabindex: 0 }, canvas);
  const element = el("div", { class: "picture veiled" }, scroll, veil);
  const choices = { ids: false, residuals: false };
  let frozen = false;
  let arrived = performance.now();
  /** @type {Preview | null} */
  let shown = null;

  /** @param {Preview} preview */
  function take(preview) {
    arrived = performance.now();
    if (frozen) return;
    shown = preview;
    draw();
    lift();
    seen(preview);
  }

  function draw() {
    const to = canvas.getContext("2d");
    if (!to || !shown) return;
    const scale = fit();
    to.setTransform(scale, 0, 0, scale, 0, 0);
    to.fillStyle = "#000";
    to.fillRect(0, 0, FRAME.columns, FRAME.lines);
    if (!shown.rows) return;
    drawBits(bits, shown);
    to.drawImage(bits, 0, 0, shown.columns, shown.rows, 0, 0, shown.columns, shown.rows * shown.yStep);
    drawOverlay(to, shown, deviceOf(store.get())?.views ?? {}, choices, devicePixelRatio / scale);
  }

  /** As many pixels as the screen has there; returns how many a frame pixel gets. */
  function fit() {
    const width = Math.max(1, Math.round(canvas.clientWidth * devicePixelRatio));
    const height = Math.round((width * FRAME.lines) / FRAME.columns);
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    return width / FRAME.columns;
  }

  /** Veils a picture that is out of date, unless it is frozen on purpose. */
  function lift() {
    const age_ms = performance.now() - arrived;
    const device = deviceOf(store.get());
    veil.hidden = frozen || (age_ms <= OLD_MS && shown?.outcome !== "no_signal");
    if (veil.hidden) return;
    const isDark = device?.state === "no_signal" || (age_ms <= OLD_MS && shown?.outcome === "no_signal");
    setText(veil, isDark ? t("live.noPicture") : t("live.old"));
  }

  const feed = createFeed(context, take);
  const ticking = setInterval(lift, LOOK_MS);
  const resized = new ResizeObserver(draw);
  resized.observe(canvas);
  return {
    element,
    /** @param {boolean} stop */
    freeze(stop) {
      frozen = stop;
      element.classList.toggle("frozen", stop);
      lift();
    },
    /** @param {"ids" | "residuals"} name @param {boolean} on */
    choose(name, on) {
      choices[name] = on;
      element.classList.toggle("large", choices.ids); // numbers need room; a phone scrolls
      draw();
    },
    unmount() {
      feed.unmount();
      clearInterval(ticking);
      resized.disconnect();
    },
  };
}
