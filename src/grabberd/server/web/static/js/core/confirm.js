// A question before something that cannot be undone.
import { el } from "./dom.js";

/**
 * @typedef {object} Question
 * @property {string} title
 * @property {string} [text]
 * @property {Node} [body] shown below the text
 * @property {string} action label of the button that goes on
 * @property {boolean} [danger]
 */

/** @param {(key: string) => string} t */
export function createConfirm(t) {
  /** Asks, and waits for the answer. @param {Question} question @returns {Promise<boolean>} */
  return function confirm({ title, text, body, action, danger = false }) {
    const cancel = el("button", { class: "button", type: "button" }, t("core.cancel"));
    const go = el("button", { class: `button ${danger ? "danger" : "primary"}`, type: "button" }, action);
    const heading = el("h2", { id: "question" }, title);
    const buttons = el("div", { class: "row end" }, cancel, go);
    const dialog = el("dialog", { class: "dialog", "aria-labelledby": "question" }, heading, text && el("p", {}, text), body, buttons);
    return new Promise((resolve) => {
      cancel.addEventListener("click", () => dialog.close());
      go.addEventListener("click", () => dialog.close("yes"));
      dialog.addEventListener("close", () => {
        dialog.remove();
        resolve(dialog.returnValue === "yes");
      });
      document.body.append(dialog);
      dialog.showModal();
      cancel.focus();
    });
  };
}
