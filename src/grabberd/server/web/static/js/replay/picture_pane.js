// The picture of the playhead's field, with rings, ids and residuals. It says itself which field it is of: one that comes
// too late is never shown for another.
import { periodOf, reasonIn } from "../captures/words.js";
import { ApiProblem } from "../core/api.js";
import { el, setText } from "../core/dom.js";
import { drawOverlay } from "../live/overlay.js";
import { createBitmaps } from "./bitmaps.js";
import { outcomeOf } from "./source.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture, Views } from "types/documents" */
/** @import { ReplayPicture, ReplayPoints } from "./messages.js" */

/** Of a picture before one has come. */
const FRAME = { columns: 720, lines: 576 };
const VIEWS = ["both", "left", "right"];
const CHOICES = /** @type {const} */ (["rings", "ids", "residuals"]);

/** @typedef {{n: number, picture: ReplayPicture | undefined, points: ReplayPoints | undefined, settled: boolean, problem: unknown}} Shown */

/**
 * @param {Context} context
 * @param {() => Capture} captureOf
 * @param {() => Views} viewsOf
 */
export function createPicturePane(context, captureOf, viewsOf) {
  const { t, format } = context;
  const canvas = el("canvas", { class: "replay-picture", role: "img", width: FRAME.columns, height: FRAME.lines });
  const words = el("p", { class: "replay-of number" });
  const missing = el("p", { class: "picture-missing", hidden: true });
  const bitmaps = createBitmaps();
  const chosen = { rings: true, ids: false, residuals: false };
  let view = "both";
  let frame = FRAME;
  /** @type {Shown | null} */
  let shown = null;
  /** Field that the canvas has the picture of. @type {ReplayPicture | null} */
  let drawn = null;

  const buttons = CHOICES.map((name) => el("button", { class: "button", type: "button", "aria-pressed": String(chosen[name]), data: { toggle: name }, on: { click: () => choose(name) } }, t(`replay.picture.${name}`)));
  const select = el("select", { class: "input", "aria-label": t("capture.whichView"), on: { change: () => look(select.value) } }, VIEWS.map((name) => el("option", { value: name }, t(`capture.view.${name}`))));
  const place = el("div", { class: "replay-frame" }, canvas, missing);
  const element = el("div", { class: "replay-body" }, el("div", { class: "replay-tools" }, buttons, select), place, words);

  /** @param {typeof CHOICES[number]} name */
  function choose(name) {
    chosen[name] = !chosen[name];
    buttons[CHOICES.indexOf(name)].setAttribute("aria-pressed", String(chosen[name]));
    redraw();
  }

  /** @param {string} name */
  function look(name) {
    view = name;
    redraw();
  }

  function redraw() {
    if (!shown) return;
    drawn = null;
    show(shown);
  }

  /** @param {Shown} now */
  function show(now) {
    shown = now;
    const bitmap = now.picture && bitmaps.at(now.n);
    if (bitmap) paint(now, bitmap);
    else if (now.picture) bitmaps.decode(now.picture).then(() => (shown === now ? lateFor(now) : null));
    else clear();
    tell(now);
  }

  /** @param {Shown} now */
  function lateFor(now) {
    const bitmap = bitmaps.at(now.n);
    if (bitmap) paint(now, bitmap);
    tell(now);
  }

  /** Part of the frame that is looked at: its first column, and how many. */
  function part() {
    const { left } = viewsOf();
    const middle = left?.end_column ?? frame.columns / 2;
    return { both: [0, frame.columns], left: [0, middle], right: [middle, frame.columns - middle] }[view] ?? [0, frame.columns];
  }

  /** @returns {CanvasRenderingContext2D} in frame pixels, whose centres are whole numbers */
  function pen() {
    const [first, columns] = part();
    const scale = Math.min(2, Math.max(1, devicePixelRatio));
    const [width, height] = [Math.round(columns * scale), frame.lines * scale];
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const to = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d", { alpha: false }));
    to.setTransform(scale, 0, 0, scale, (0.5 - first) * scale, 0.5 * scale);
    return to;
  }

  function clear() {
    const to = pen();
    to.fillStyle = "#000";
    to.fillRect(-1, -1, frame.columns + 1, frame.lines + 1);
    drawn = null;
    return to;
  }

  /** @param {Shown} now @param {ImageBitmap} bitmap */
  function paint({ picture, points }, bitmap) {
    if (!picture) return;
    frame = { columns: bitmap.width, lines: bitmap.height * picture.yStep };
    const to = clear();
    to.imageSmoothingEnabled = picture.yStep > 1;
    to.drawImage(bitmap, -0.5, picture.y0 - picture.yStep / 2, bitmap.width, bitmap.height * picture.yStep);
    const images = Array.from(points?.target ?? [], (target, i) => ({ target, image: [0, 1, 2, 3].map((k) => points?.image_px[4 * i + k] ?? NaN), residual: points?.residual_px[i] ?? NaN }));
    const centroids = Float32Array.from(chosen.rings ? images.flatMap(({ image }) => image) : []);
    to.translate(-0.5, -0.5); // the overlay counts from the frame's corner
    const unit = frame.columns / Math.max(1, canvas.clientWidth || frame.columns);
    drawOverlay(to, { frame, centroids, points: images }, viewsOf(), { ids: chosen.ids, residuals: chosen.residuals }, unit);
    drawn = picture;
  }

  /** Which field the picture is of, and what is to be said of the playhead's. @param {Shown} now */
  function tell(now) {
    const { outcome, reason } = outcomeOf(captureOf(), now.n);
    const sentence = () => {
      if (now.problem) return now.problem instanceof ApiProblem && now.problem.status ? t("replay.picture.unreadable", { reason: now.problem.detail }) : t("replay.picture.noAnswer");
      if (outcome !== "received" && outcome !== "unlisted") return `${t(`capture.isNot.${outcome}`)} ${reasonIn(context, reason)}.`;
      if (!now.settled) return t("replay.picture.coming", { n: now.n });
      return now.picture ? "" : t("replay.picture.none");
    };
    const text = sentence();
    missing.hidden = !text;
    setText(missing, text);
    place.classList.toggle("is-late", drawn !== null && drawn.n !== now.n);
    const late = now.picture && drawn?.n !== now.n;
    setText(words, late ? t("replay.picture.late", { n: drawn?.n ?? "–", wanted: now.n }) : t("capture.field", { n: now.n, s: format.number(now.n * periodOf(captureOf()), 2) }));
    canvas.setAttribute("aria-label", t("capture.picture", { n: now.n, s: format.number(now.n * periodOf(captureOf()), 2) }));
  }

  return {
    element, canvas, show,
    /** @param {(ReplayPicture | undefined)[]} pictures the next ones, in order */
    prepare(pictures) {
      for (const one of pictures) if (one) bitmaps.decode(one);
    },
    /** Waits until the picture of what is shown is drawn, if there is one. */
    async whole() {
      const now = shown;
      if (!now?.picture) return;
      await bitmaps.decode(now.picture);
      if (shown === now && drawn?.n !== now.n) lateFor(now);
    },
    /** What stands over the picture in words. */
    said: () => (missing.hidden ? "" : missing.textContent ?? ""),
    end: bitmaps.end,
  };
}
