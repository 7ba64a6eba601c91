// Turning, shifting and zooming by mouse, fingers, wheel and keys.
import { listen } from "../core/listen.js";
import { shifted, turned, zoomed } from "./orbit.js";

/** @import { Orbit } from "./orbit.js" */

const DEG_A_PIXEL = 0.4;
const KEY_DEG = 7.5;
const KEY_ZOOM = 1.2;
/** A touch that moves no farther is a tap. */
const TAP_PIXELS = 8;

/** @typedef {{x: number, y: number}} At in CSS pixels */

/** @type {Record<string, (orbit: Orbit) => Orbit>} */
const KEYS = {
  ArrowLeft: (orbit) => turned(orbit, -KEY_DEG, 0),
  ArrowRight: (orbit) => turned(orbit, KEY_DEG, 0),
  ArrowUp: (orbit) => turned(orbit, 0, KEY_DEG),
  ArrowDown: (orbit) => turned(orbit, 0, -KEY_DEG),
  "+": (orbit) => zoomed(orbit, KEY_ZOOM),
  "=": (orbit) => zoomed(orbit, KEY_ZOOM),
  "-": (orbit) => zoomed(orbit, 1 / KEY_ZOOM),
};

/**
 * @param {HTMLElement} element
 * @param {(change: (orbit: Orbit) => Orbit) => void} change
 * @param {(x: number, y: number) => void} tap
 * @returns {() => void} ends it
 */
export function listenToPointers(element, change, tap) {
  /** @type {Map<number, At>} */
  const down = new Map();
  let moved = 0;

  /** @param {PointerEvent} event */
  function press(event) {
    element.setPointerCapture(event.pointerId);
    down.set(event.pointerId, { x: event.clientX, y: event.clientY });
    moved = down.size > 1 ? Infinity : 0;
  }

  /** @param {PointerEvent} event */
  function move(event) {
    const before = down.get(event.pointerId);
    if (!before) return;
    const now = { x: event.clientX, y: event.clientY };
    const others = [...down].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
    down.set(event.pointerId, now);
    moved += Math.hypot(now.x - before.x, now.y - before.y);
    if (moved <= TAP_PIXELS) return;
    if (others.length) change((orbit) => pinched(orbit, others[0], before, now));
    else if (event.shiftKey || event.buttons === 2) change((orbit) => dragged(orbit, before, now));
    else change((orbit) => turned(orbit, (before.x - now.x) * DEG_A_PIXEL, (now.y - before.y) * DEG_A_PIXEL));
  }

  /** @param {Orbit} orbit @param {At} before @param {At} now @returns {Orbit} */
  function dragged(orbit, before, now) {
    const radii = 2 / Math.max(1, Math.min(element.clientWidth, element.clientHeight)) / orbit.zoom;
    return shifted(orbit, (now.x - before.x) * radii, (before.y - now.y) * radii);
  }

  /** Two fingers: their distance zooms, their middle shifts. @param {Orbit} orbit @param {At} still @param {At} before @param {At} now */
  function pinched(orbit, still, before, now) {
    const apart = (/** @type {At} */ place) => Math.hypot(place.x - still.x, place.y - still.y) || 1;
    const middle = (/** @type {At} */ place) => ({ x: (place.x + still.x) / 2, y: (place.y + still.y) / 2 });
    return dragged(zoomed(orbit, apart(now) / apart(before)), middle(before), middle(now));
  }

  /** @param {PointerEvent} event */
  function release(event) {
    const pressed = down.delete(event.pointerId);
    if (pressed && event.type === "pointerup" && moved <= TAP_PIXELS) tap(event.offsetX, event.offsetY);
  }

  /** Only while the picture has the focus or a control key is held: else the page scrolls. @param {WheelEvent} event */
  function turnWheel(event) {
    if (document.activeElement !== element && !event.ctrlKey) return;
    event.preventDefault();
    change((orbit) => zoomed(orbit, Math.exp(-event.deltaY / 500)));
  }

  /** @param {KeyboardEvent} event */
  function type(event) {
    const by = KEYS[event.key];
    if (!by || event.altKey || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    change(by);
  }

  const contextmenu = (/** @type {Event} */ event) => event.preventDefault();
  return listen(element, { pointerdown: press, pointermove: move, pointerup: release, pointercancel: release, wheel: turnWheel, keydown: type, contextmenu });
}
