// The document's elements, made and changed.

/** @typedef {Node | string | number | null | undefined | false | Child[]} Child */

const SPRITE = new URL("../../symbols.svg", import.meta.url).href;
const SVG = "http://www.w3.org/2000/svg";
const PROPERTIES = new Set(["value", "checked", "disabled", "hidden", "selected", "open", "indeterminate"]);

/**
 * Makes an element.
 *
 * Keys of `attributes`: `class` (text), `on` ({event: listener}), `data` ({name: text}), properties such as
 * `disabled` and `hidden` (boolean), anything else an attribute; null and undefined are left out, true gives
 * an empty one. There is no way to set inner HTML or a style in the markup.
 * @param {string} tag
 * @param {Record<string, any>} [attributes]
 * @param {...Child} children
 * @returns {any}
 */
export function el(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) set(made, name, value);
  made.append(...nodes(children));
  return made;
}

/** @param {any} made @param {string} name @param {any} value */
function set(made, name, value) {
  if (value === null || value === undefined) return;
  if (name === "on") for (const [event, listener] of Object.entries(value)) made.addEventListener(event, listener);
  else if (name === "data") Object.assign(made.dataset, value);
  else if (PROPERTIES.has(name)) made[name] = value;
  else if (value !== false) made.setAttribute(name, value === true ? "" : String(value));
}

/** @param {Child[]} children @returns {(Node | string)[]} */
function nodes(children) {
  const given = children.flat(9).filter((child) => child !== null && child !== undefined && child !== false);
  return given.map((child) => (child instanceof Node ? child : String(child)));
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
