// Over the picture: which way the axes point, how long ten millimetres are, the cameras' names.
import { el, fill, setText } from "../core/dom.js";
import { axesOf } from "./orbit.js";

/** @import { Orbit } from "./orbit.js" */
/** @import { Shown, Stage } from "./stage.js" */

const LETTERS = ["X", "Y", "Z"];
const SVG = "http://www.w3.org/2000/svg";
const LONG = 24;
const LENGTHS_MM = [1, 2, 5, 10, 20, 50, 100, 200];
const LEAST_PIXELS = 60;
const ASIDE = 18;

/** @param {(view: string) => string} nameOf a camera */
export function createLabels(nameOf) {
  const compass = createCompass();
  const ruler = el("div", { class: "scene-ruler number" });
  const names = el("div");
  const ring = el("div", { class: "scene-ring", hidden: true });
  const element = el("div", { class: "scene-labels", "aria-hidden": "true" }, ring, names, compass.element, ruler);

  /** @param {Stage} stage @param {Shown} shown */
  function place(stage, shown) {
    mark(shown.marked_mm ? stage.onCanvas(shown.marked_mm) : null);
    compass.turn(shown.orbit);
    measure(stage.pixelsPerMm(shown));
    fill(names, ...shown.frusta.map(({ name, apex_mm }) => nameAt(nameOf(name), name, stage.onCanvas(apex_mm))));
    for (const one of names.children) keepWithin(/** @type {HTMLElement} */ (one), element);
  }

  /** The chosen target. @param {{x: number, y: number} | null} at */
  function mark(at) {
    ring.hidden = at === null;
    if (at) ring.style.transform = `translate(${at.x.toFixed(1)}px, ${at.y.toFixed(1)}px) translate(-50%, -50%)`;
  }

  /** @param {number} pixels of a millimetre */
  function measure(pixels) {
    const long_mm = LENGTHS_MM.find((mm) => mm * pixels >= LEAST_PIXELS) ?? 500;
    setText(ruler, `${long_mm} mm`);
    ruler.style.inlineSize = `${(long_mm * pixels).toFixed(1)}px`;
  }
  return { element, place };
}

/** @param {string} text @param {string} name @param {{x: number, y: number} | null} at */
function nameAt(text, name, at) {
  if (!at) return null;
  const made = el("span", { class: "scene-camera", data: { view: name } }, text);
  Object.assign(made.dataset, { x: at.x, y: at.y + (name === "left" ? -ASIDE : ASIDE) });
  return made;
}

/** A name stays whole on the picture, however near its edge the camera is. @param {HTMLElement} one @param {HTMLElement} place */
function keepWithin(one, place) {
  const within = (/** @type {string | undefined} */ middle, /** @type {number} */ long, /** @type {number} */ room) =>
    Math.min(Math.max(Number(middle) - long / 2, 4), Math.max(4, room - long - 4)).toFixed(1);
  const x = within(one.dataset.x, one.offsetWidth, place.clientWidth);
  const y = within(one.dataset.y, one.offsetHeight, place.clientHeight);
  one.style.transform = `translate(${x}px, ${y}px)`;
}

/** Three arrows in a corner, as the object's axes lie. */
function createCompass() {
  const element = make("svg", { class: "scene-compass", viewBox: "-40 -40 80 80" });
  const lines = LETTERS.map(() => make("line", { x1: 0, y1: 0 }));
  const letters = LETTERS.map((letter) => make("text", {}, letter));
  element.append(...lines, ...letters);

  /** @param {Orbit} orbit */
  function turn(orbit) {
    const { right, up } = axesOf(orbit);
    LETTERS.forEach((_, i) => {
      set(lines[i], { x2: LONG * right[i], y2: -LONG * up[i] });
      const apart = Math.hypot(right[i], up[i]);
      const reach = apart > 0.2 ? LONG + 9 / apart : 0;
      set(letters[i], { x: reach * right[i] || 9, y: -reach * up[i] || -9 });
    });
  }
  return { element, turn };
}

/** @param {string} tag @param {Record<string, string | number>} attributes @param {string} [text] */
function make(tag, attributes, text = "") {
  const made = document.createElementNS(SVG, tag);
  set(made, attributes);
  made.textContent = text;
  return made;
}

/** @param {Element} element @param {Record<string, string | number>} attributes */
function set(element, attributes) {
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
}
