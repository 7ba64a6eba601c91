// A chart's gestures: drag, pinch, wheel, taps and keys, along its x.
import { listen } from "../core/listen.js";

/** A touch that moves no farther is a tap. */
const TAP_PIXELS = 8;
const DOUBLE_MS = 350;
const DOUBLE_PIXELS = 40;
const KEY_ZOOM = 1.5;
const KEY_SHIFT = 0.2;
const WHEEL_PIXELS = 400;

/**
 * @typedef {object} Gestures places are shares of the drawing's width
 * @property {() => boolean} isWhole true if all there is is shown
 * @property {(at: number, factor: number) => void} zoom
 * @property {(by: number) => void} shift
 * @property {(from: number, to: number, ended: boolean) => void} sweep drawn over, by a mouse, while all is shown
 * @property {(at: number) => void} read a finger lies there, while all is shown
 * @property {(at: number) => void} tap
 * @property {() => void} reset
 * @property {(samples: number) => void} step the cursor
 */

/** @param {HTMLElement} element @param {() => DOMRect | null} area of the drawing in it @param {Gestures} on @returns {() => void} ends it */
export function listenToGestures(element, area, on) {
  /** @type {Map<number, {x: number, y: number}>} */
  const down = new Map();
  let began = 0;
  let moved = 0;
  let sweeps = false;
  let last = { ms: -Infinity, x: 0, y: 0 };

  /** @param {number} x of the window */
  function shareOf(x) {
    const box = area();
    return box?.width ? Math.min(Math.max((x - box.left) / box.width, 0), 1) : 0;
  }
  const width = () => area()?.width || 1;

  /** @param {PointerEvent} event */
  function press(event) {
    if (event.button > 0) return;
    down.set(event.pointerId, { x: event.clientX, y: event.clientY });
    moved = down.size > 1 ? Infinity : 0;
    began = shareOf(event.clientX);
    sweeps = event.pointerType === "mouse" && on.isWhole();
  }

  /** @param {PointerEvent} event */
  function move(event) {
    const before = down.get(event.pointerId);
    if (!before) return;
    const now = { x: event.clientX, y: event.clientY };
    const [other] = [...down].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
    down.set(event.pointerId, now);
    moved += Math.hypot(now.x - before.x, now.y - before.y);
    if (moved <= TAP_PIXELS) return;
    element.setPointerCapture(event.pointerId);
    if (other) pinch(other.x, before.x, now.x);
    else if (sweeps) on.sweep(began, shareOf(now.x), false);
    else if (on.isWhole()) on.read(shareOf(now.x));
    else on.shift((before.x - now.x) / width());
  }

  /** Two fingers: how far they are apart along x zooms, their middle shifts. @param {number} still @param {number} before @param {number} now */
  function pinch(still, before, now) {
    const apart = (/** @type {number} */ x) => Math.max(Math.abs(x - still), 20);
    on.zoom(shareOf((still + now) / 2), apart(now) / apart(before));
    on.shift((before - now) / 2 / width());
  }

  /** @param {PointerEvent} event */
  function release(event) {
    if (!down.delete(event.pointerId)) return;
    if (moved > TAP_PIXELS) {
      if (sweeps) on.sweep(began, shareOf(event.clientX), event.type === "pointerup");
      sweeps = false;
    } else if (event.type === "pointerup") tap(event);
  }

  /** @param {PointerEvent} event */
  function tap({ timeStamp, clientX, clientY }) {
    const near = Math.hypot(clientX - last.x, clientY - last.y) < DOUBLE_PIXELS;
    const isDouble = near && timeStamp - last.ms < DOUBLE_MS;
    last = { ms: isDouble ? -Infinity : timeStamp, x: clientX, y: clientY };
    if (isDouble) on.reset();
    else on.tap(shareOf(clientX));
  }

  /** Only while the chart has the focus or a control key is held: else the page scrolls. @param {WheelEvent} event */
  function turnWheel(event) {
    if (document.activeElement !== element && !event.ctrlKey) return;
    event.preventDefault();
    if (Math.abs(event.deltaX) > Math.abs(event.deltaY)) on.shift(event.deltaX / width());
    else on.zoom(shareOf(event.clientX), Math.exp(-event.deltaY / WHEEL_PIXELS));
  }

  /** @type {Record<string, (far: boolean) => void>} */
  const keys = {
    ArrowLeft: (far) => (far ? on.shift(-KEY_SHIFT) : on.step(-1)),
    ArrowRight: (far) => (far ? on.shift(KEY_SHIFT) : on.step(1)),
    PageUp: () => on.step(-10),
    PageDown: () => on.step(10),
    "+": () => on.zoom(NaN, KEY_ZOOM),
    "=": () => on.zoom(NaN, KEY_ZOOM),
    "-": () => on.zoom(NaN, 1 / KEY_ZOOM),
    0: on.reset,
    Escape: on.reset,
  };

  /** @param {KeyboardEvent} event */
  function type(event) {
    const by = keys[event.key];
    if (!by || event.altKey || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    by(event.shiftKey);
  }

  return listen(element, { pointerdown: press, pointermove: move, pointerup: release, pointercancel: release, wheel: turnWheel, keydown: type });
}
