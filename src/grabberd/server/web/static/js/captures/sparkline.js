// The course of the wall's width as a small curve.
import { el } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture } from "types/documents" */

const SVG = "http://www.w3.org/2000/svg";
const [WIDTH, HEIGHT] = [120, 30];

/** Widths that were asked for, by capture: a sealed one's never change while the page is open. @type {Map<string, (number | null)[]>} */
const known = new Map();
const MOST_KNOWN = 1000;

/** Its place in a row; the curve comes when it is known. @param {Context} context @param {Capture} capture */
export function createSparkline(context, capture) {
  const element = el("span", { class: "capture-spark" });
  const sealed = capture.state === "sealed" && capture.runs.length > 0;
  const widths = known.get(keyOf(capture));
  if (widths) draw(context, element, widths);
  else if (sealed) context.api.get(`/captures/${encodeURIComponent(capture.id)}/widths`).then((found) => take(capture, found.widths_mm) && draw(context, element, found.widths_mm), () => {}); // without one the row says enough
  return element;
}

/** Takes up what came with a list. @param {Capture} capture @param {(number | null)[]} widths */
export function take(capture, widths) {
  if (known.size >= MOST_KNOWN) known.delete(known.keys().next().value ?? "");
  return known.set(keyOf(capture), widths);
}

/** A new run has other widths. @param {Capture} capture */
const keyOf = (capture) => `${capture.id} ${capture.runs.length}`;

/** @param {Context} context @param {HTMLElement} element @param {(number | null)[]} widths */
function draw({ t, format }, element, widths) {
  const seen = widths.filter((one) => one !== null);
  if (seen.length < 2) return;
  const [low, high] = [Math.min(...seen), Math.max(...seen)];
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
  svg.setAttribute("preserveAspectRatio", "none");
  svg.setAttribute("role", "img");
  svg.setAttribute("aria-label", t("captures.spark", { low: format.number(low, 1), high: format.number(high, 1) }));
  const path = document.createElementNS(SVG, "path");
  path.setAttribute("d", pathOf(widths, low, Math.max(high - low, 1)));
  svg.append(path);
  element.replaceChildren(svg);
}

/** With a gap where nothing was measured. @param {(number | null)[]} widths @param {number} low @param {number} span */
function pathOf(widths, low, span) {
  const at = (/** @type {number} */ i, /** @type {number} */ width) => `${((i / (widths.length - 1)) * WIDTH).toFixed(1)} ${(HEIGHT - 2 - ((width - low) / span) * (HEIGHT - 4)).toFixed(1)}`;
  return widths.map((width, i) => (width === null ? "" : `${i && widths[i - 1] !== null ? "L" : "M"}${at(i, width)}`)).join("");
}
