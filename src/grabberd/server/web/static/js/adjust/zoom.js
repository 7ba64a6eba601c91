// Zooming and shifting the live picture by fingers, mouse, wheel, keys and buttons.
import { listen } from "../core/listen.js";
import { el } from "../core/dom.js";
import { WHOLE, centred, middleOf, shifted, zoomed } from "../live/view.js";

/** @import { Context } from "../core/context.js" */
/** @import { Picture } from "../live/picture.js" */
/** @import { View } from "../live/view.js" */

const STEP = 1.6;
const TAPPED = 3;
const KEY_SHARE = 0.15;
const TAP_PIXELS = 10;
const TWICE_MS = 350;
const TWICE_PIXELS = 40;

/** @typedef {{x: number, y: number}} At in CSS pixels */

/** @param {Context} context @param {Picture} picture */
export function createZoom({ t }, picture) {
  const { canvas } = picture;
  /** @type {Map<number, At>} */
  const down = new Map();
  let moved = 0;
  let tapped = { time: -Infinity, x: 0, y: 0 };

  const button = (/** @type {string} */ name, /** @type {string} */ sign, /** @type {() => void} */ press) =>
    el("button", { class: "button icon", type: "button", "aria-label": t(`live.zoom.${name}`), title: t(`live.zoom.${name}`), data: { zoom: name }, on: { click: press } }, sign);
  const whole = el("button", { class: "button", type: "button", data: { zoom: "whole" }, on: { click: () => change(() => WHOLE) } }, t("live.zoom.whole"));
  const element = el("div", { class: "row zoom-bar", role: "group", "aria-label": t("live.zoom.title") },
    button("out", "−", () => byMiddle(1 / STEP)), button("in", "+", () => byMiddle(STEP)), whole);

  /** @param {(view: View) => View} change */
  function change(change) {
    picture.look(change(picture.view()));
    whole.disabled = picture.view().zoom <= 1;
    canvas.classList.toggle("is-zoomed", !whole.disabled);
  }

  /** From the whole picture to the left view: in the middle the two views meet, and there is nothing. @param {number} factor */
  function byMiddle(factor) {
    const frame = picture.frame();
    const left = { x: frame.columns / 4, y: frame.lines / 2 };
    change((view) => (view.zoom > 1 ? zoomed(view, factor, middleOf(view, frame), frame) : centred(left, factor, frame)));
  }

  /** How many frame pixels a CSS pixel is. */
  const unit = () => picture.frame().columns / picture.view().zoom / Math.max(canvas.clientWidth, 1);

  /** The place of the frame under a place of the page. @param {At} at */
  function frameAt(at) {
    const box = canvas.getBoundingClientRect();
    const view = picture.view();
    return { x: view.x + (at.x - box.left) * unit(), y: view.y + (at.y - box.top) * unit() };
  }

  /** @param {PointerEvent} event */
  function press(event) {
    down.set(event.pointerId, { x: event.clientX, y: event.clientY });
    moved = down.size > 1 ? Infinity : 0;
    if (picture.view().zoom > 1 || down.size > 1) canvas.setPointerCapture(event.pointerId);
  }

  /** @param {PointerEvent} event */
  function move(event) {
    const before = down.get(event.pointerId);
    if (!before) return;
    const now = { x: event.clientX, y: event.clientY };
    const [other] = [...down].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
    down.set(event.pointerId, now);
    moved += Math.hypot(now.x - before.x, now.y - before.y);
    if (other) pinch(other, before, now);
    else if (moved > TAP_PIXELS) drag(before, now);
  }

  /** @param {At} before @param {At} now */
  function drag(before, now) {
    change((view) => shifted(view, (before.x - now.x) * unit(), (before.y - now.y) * unit(), picture.frame()));
  }

  /** Two fingers: their distance zooms, their middle shifts. @param {At} still @param {At} before @param {At} now */
  function pinch(still, before, now) {
    const apart = (/** @type {At} */ place) => Math.hypot(place.x - still.x, place.y - still.y) || 1;
    const middle = (/** @type {At} */ place) => ({ x: (place.x + still.x) / 2, y: (place.y + still.y) / 2 });
    change((view) => zoomed(view, apart(now) / apart(before), frameAt(middle(before)), picture.frame()));
    drag(middle(before), middle(now));
  }

  /** @param {PointerEvent} event */
  function release(event) {
    if (!down.delete(event.pointerId) || event.type !== "pointerup" || moved > TAP_PIXELS) return;
    const at = { x: event.clientX, y: event.clientY };
    const twice = event.timeStamp - tapped.time < TWICE_MS && Math.hypot(at.x - tapped.x, at.y - tapped.y) < TWICE_PIXELS;
    tapped = { time: twice ? -Infinity : event.timeStamp, ...at };
    if (twice) change((view) => (view.zoom > 1 ? WHOLE : zoomed(view, TAPPED, frameAt(at), picture.frame())));
  }

  /** Only while the picture has the focus or a control key is held: else the page scrolls. @param {WheelEvent} event */
  function turnWheel(event) {
    if (document.activeElement !== canvas && !event.ctrlKey) return;
    event.preventDefault();
    change((view) => zoomed(view, Math.exp(-event.deltaY / 400), frameAt({ x: event.clientX, y: event.clientY }), picture.frame()));
  }

  /** @type {Record<string, () => void>} */
  const keys = {
    "+": () => byMiddle(STEP), "=": () => byMiddle(STEP), "-": () => byMiddle(1 / STEP),
    "0": () => change(() => WHOLE), Escape: () => change(() => WHOLE),
    ArrowLeft: () => step(-1, 0), ArrowRight: () => step(1, 0), ArrowUp: () => step(0, -1), ArrowDown: () => step(0, 1),
  };

  /** @param {number} right @param {number} down */
  function step(right, down) {
    const { columns, lines } = picture.frame();
    change((view) => shifted(view, (KEY_SHARE * right * columns) / view.zoom, (KEY_SHARE * down * lines) / view.zoom, picture.frame()));
  }

  /** @param {KeyboardEvent} event */
  function type(event) {
    const act = keys[event.key];
    const scrolls = event.key.startsWith("Arrow") && picture.view().zoom <= 1;
    if (!act || scrolls || event.altKey || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    act();
  }

  const unmount = listen(canvas, { pointerdown: press, pointermove: move, pointerup: release, pointercancel: release, wheel: turnWheel, keydown: type });
  change((view) => view);
  return { element, unmount };
}
