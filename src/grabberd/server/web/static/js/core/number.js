// A number as it is typed: its decimal sign is a point or a comma, whatever the language of page and browser. Nothing here touches the page.

/**
 * @typedef {object} Limits
 * @property {number} [least]
 * @property {number} [most]
 * @property {boolean} [isWhole] without decimals
 */

const FORM = /^[-+\u2212]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:e[-+]?\d+)?$/i;
const WHOLE = /^[-+\u2212]?\d+$/;

/** The number that was typed; null: nothing was, NaN: it is none. @param {string | undefined} typed */
export function numberOf(typed) {
  const text = (typed ?? "").trim();
  if (text === "") return null;
  const value = FORM.test(text) ? Number(text.replace(",", ".").replace("\u2212", "-")) : NaN;
  return Number.isFinite(value) ? value : NaN;
}

/** Name of what keeps a number from being used; null: nothing does, or nothing was typed. @param {string} typed @param {Limits} [limits] */
export function problemOf(typed, { least = -Infinity, most = Infinity, isWhole = false } = {}) {
  const value = numberOf(typed);
  if (value === null) return null;
  if (Number.isNaN(value)) return "none";
  if (isWhole && !WHOLE.test(typed.trim())) return "whole";
  if (value < least) return "least";
  return value > most ? "most" : null;
}
