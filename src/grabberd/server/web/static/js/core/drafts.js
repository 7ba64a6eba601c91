// What was typed and is not stored yet, until the tab is closed: another panel, a reload, a restart of the daemon or a new sign-in takes nothing of it away.
import { el } from "./dom.js";

/** @import { Context } from "./context.js" */

/** @typedef {Record<string, string>} Texts what was typed, by the name of its field */

/** What was typed into a form; null if nothing was. @param {string} form @returns {Texts | null} */
export function draftOf(form) {
  try {
    const found = JSON.parse(sessionStorage.getItem(keyOf(form)) ?? "null");
    if (found === null || typeof found !== "object") return null;
    return Object.fromEntries(Object.entries(found).filter(([, text]) => typeof text === "string"));
  } catch {
    return null;
  }
}

/** @param {string} form @param {Texts | null} texts null: it is stored now, or not wanted any more */
export function keepDraft(form, texts) {
  try {
    if (texts === null) sessionStorage.removeItem(keyOf(form));
    else sessionStorage.setItem(keyOf(form), JSON.stringify(texts));
  } catch {
    // a browser that keeps nothing
  }
}

/** Says that a form goes on with its draft, which can be discarded. @param {Context} context @param {string} form @param {() => void} discarded */
export function resumedNote({ t }, form, discarded) {
  const discard = () => {
    keepDraft(form, null);
    discarded();
  };
  return el("p", { class: "row between muted" }, t("core.resumed"), el("button", { class: "button", type: "button", data: { do: "discard" }, on: { click: discard } }, t("core.discard")));
}

/** @param {string} form */
const keyOf = (form) => `grabberd.draft.${form}`;
