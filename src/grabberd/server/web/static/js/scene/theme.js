// The page's colours, light or dark, for what is not drawn by CSS.

/** @typedef {[number, number, number]} Rgb red, green, blue from 0 to 1 */

/**
 * @template {string} Name
 * @param {HTMLElement} element the colours are those that hold there
 * @param {Record<Name, string>} tokens the colours' custom properties, without the dashes
 * @returns {Record<Name, Rgb>} by the same names
 */
export function coloursOf(element, tokens) {
  const probe = document.createElement("span");
  probe.hidden = true;
  element.append(probe);
  const read = (/** @type {string} */ name) => {
    probe.style.color = `var(--${name})`;
    return parsed(getComputedStyle(probe).color);
  };
  const colours = Object.entries(tokens).map(([name, token]) => [name, read(/** @type {string} */ (token))]);
  probe.remove();
  return Object.fromEntries(colours);
}

/**
 * Calls when the page turns light or dark.
 * @param {() => void} listener
 * @returns {() => void} ends it
 */
export function onTheme(listener) {
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const chosen = new MutationObserver(listener);
  dark.addEventListener("change", listener);
  chosen.observe(document.documentElement, { attributes: true, attributeFilter: ["data-look"] });
  return () => {
    dark.removeEventListener("change", listener);
    chosen.disconnect();
  };
}

/** @param {string} text "rgb(12, 34, 56)" or "color(srgb 0.1 0.2 0.3)" @returns {Rgb} */
function parsed(text) {
  const parts = (text.match(/[\d.]+(?:e-?\d+)?/g) ?? []).slice(0, 3).map(Number);
  const most = text.startsWith("color") ? 1 : 255;
  return /** @type {Rgb} */ (parts.map((part) => part / most));
}
