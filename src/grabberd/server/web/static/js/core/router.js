// The panel that the address asks for: #captures/ID. What follows a question mark is the panel's own affair.

/** @import { Entry } from "../panels/index.js" */

/**
 * @typedef {object} Route
 * @property {Entry} entry
 * @property {Record<string, string>} parameters by their names in the pattern
 */

/** @param {Entry[]} entries @param {string} hash @returns {Route} the first panel's where none fits */
export function routeOf(entries, hash) {
  const parts = hash.replace(/^#\/?/, "").split("?")[0].split("/").filter(Boolean).map(decodeURIComponent);
  for (const entry of entries) {
    const parameters = match(entry.route.split("/"), parts);
    if (parameters) return { entry, parameters };
  }
  return { entry: entries[0], parameters: {} };
}

/** @param {string[]} pattern @param {string[]} parts */
function match(pattern, parts) {
  if (pattern.length !== parts.length) return null;
  /** @type {Record<string, string>} */
  const parameters = {};
  for (const [i, name] of pattern.entries()) {
    if (name.startsWith(":")) parameters[name.slice(1)] = parts[i];
    else if (name !== parts[i]) return null;
  }
  return parameters;
}

/** Goes to a panel. @param {...string} parts */
export function go(...parts) {
  location.hash = parts.map(encodeURIComponent).join("/");
}
