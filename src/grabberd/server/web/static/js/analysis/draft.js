// What was typed for the analysis of a capture, until it is made.
import { draftOf as typedIn, keepDraft as keep } from "../core/drafts.js";

/** @import { Values } from "./inputs.js" */

/**
 * @typedef {object} Draft
 * @property {Values} values of the form
 * @property {Values} known what it would say if nothing had been typed
 * @property {boolean} profiles true if profiles complete them
 */

/** @param {string} id of the capture @returns {Draft | null} */
export function draftOf(id) {
  const kept = typedIn(formOf(id));
  if (!kept) return null;
  const { profiles = "true", ...texts } = kept;
  const part = (/** @type {string} */ name) => Object.fromEntries(Object.entries(texts).filter(([key]) => key.startsWith(name)).map(([key, text]) => [key.slice(name.length), text]));
  return { values: part("values:"), known: part("known:"), profiles: profiles === "true" };
}

/** @param {string} id of the capture @param {Draft | null} draft null forgets it */
export function keepDraft(id, draft) {
  const part = (/** @type {string} */ name, /** @type {Values} */ values) => Object.entries(values).map(([key, text]) => [`${name}:${key}`, text]);
  keep(formOf(id), draft && { profiles: String(draft.profiles), ...Object.fromEntries([...part("values", draft.values), ...part("known", draft.known)]) });
}

/** @param {string} id */
const formOf = (id) => `analysis.${id}`;
