// The document's elements, made and changed.

/** @import { Attributes, Child } from "types/elements" */

const SPRITE = new URL("../../symbols.svg", import.meta.url).href;
const SVG = "http://www.w3.org/2000/svg";
const PROPERTIES = new Set(["value", "checked", "disabled", "hidden", "selected", "open", "indeterminate"]);

/**
 * Makes an element.
 *
 * Keys of `attributes`: `class` (text), `on` ({event: listener}), `data` ({name: text}), properties such as
 * `disabled` and `hidden` (boolean), anything else an attribute; null and undefined are left out, true gives
 * an empty one. There is no way to set inner HTML or a style in the markup.
 * @template {keyof HTMLElementTagNameMap} Tag
 * @param {Tag} tag
 * @param {Attributes} [attributes]
 * @param {...Child} children
 * @returns {HTMLElementTagNameMap[Tag]}
 */
export function el(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  const { on = {}, data = {}, ...others } = attributes;
  for (const [event, listener] of Object.entries(on)) made.addEventListener(event, /** @type {EventListener} */ (listener));
  Object.assign(made.dataset, data);
  for (const [name, value] of Object.entries(others)) set(made, name, value);
  made.append(...nodes(children));
  return made;
}

/** @param {HTMLElement} made @param {string} name @param {unknown} value */
function set(made, name, value) {
  if (value === null || value === undefined) return;
  // As attributes these would give only the first value, or mean true whatever they say.
  if (PROPERTIES.has(name)) Object.assign(made, { [name]: value });
  else if (value !== false) made.setAttribute(name, value === true ? "" : String(value));
}

/** @param {Child[]} children @returns {(Node | string)[]} */
function nodes(children) {
  return children.flatMap((child) => {
    if (Array.isArray(child)) return nodes(child);
    if (child === null || child === undefined || child === false) return [];
    return [child instanceof Node ? child : String(child)];
  });
}

/**
 * A symbol of the sprite `symbols.svg`; a picture only, unless it has a label.
 * @param {string} name
 * @param {string} [label]
 */
export function symbol(name, label) {
  const made = document.createElementNS(SVG, "svg");
  made.setAttribute("class", "symbol");
  if (label) {
    made.setAttribute("role", "img");
    made.setAttribute("aria-label", label);
  } else made.setAttribute("aria-hidden", "true");
  const use = document.createElementNS(SVG, "use");
  use.setAttribute("href", `${SPRITE}#${name}`);
  made.append(use);
  return made;
}

/** Changes which symbol is shown. @param {Element} made @param {string} name */
export function setSymbol(made, name) {
  const href = `${SPRITE}#${name}`;
  const use = made.firstElementChild;
  if (use && use.getAttribute("href") !== href) use.setAttribute("href", href);
}

/** Puts children in place of those it has. @param {Element} parent @param {...Child} children */
export function fill(parent, ...children) {
  parent.replaceChildren(...nodes(children));
}

/** Changes a text, if it differs: what is read aloud is read once. @param {Element} node @param {string} text */
export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}
