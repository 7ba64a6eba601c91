// Short messages: seen for a while at the edge of the page, and read aloud.
import { ApiProblem, statusOf } from "./api.js";
import { el, symbol } from "./dom.js";

const SHOWN_MS = 8000;
const SYMBOLS = { info: "info", good: "ok", bad: "bad" };

/**
 * @typedef {object} Announcement
 * @property {"info" | "good" | "bad"} [kind] a bad one stays until it is closed
 * @property {string} [hint]
 */

/** @param {(key: string) => string} t */
export function createAnnouncer(t) {
  const region = el("div", { class: "toasts", role: "status", "aria-live": "polite" });

  /**
   * Shows a message.
   * @param {string} text
   * @param {Announcement} [options]
   */
  function announce(text, { kind = "info", hint = "" } = {}) {
    const close = el("button", { class: "button plain icon", type: "button", "aria-label": t("core.close") }, symbol("close"));
    const words = el("div", { class: "toast-words" }, el("strong", {}, text), hint && el("span", {}, hint));
    const toast = el("div", { class: `toast ${kind}` }, symbol(SYMBOLS[kind]), words, close);
    close.addEventListener("click", () => toast.remove());
    region.append(toast);
    while (region.children.length > 3) region.firstElementChild?.remove();
    if (kind !== "bad") setTimeout(() => toast.remove(), SHOWN_MS);
  }

  /** Tells why a request was refused; null, so that it can be the catch of a request. @param {unknown} problem @returns {null} */
  function refused(problem) {
    if (problem instanceof DOMException && problem.name === "AbortError") return null;
    if (statusOf(problem) === 0) announce(t("core.noAnswer"), { kind: "bad", hint: t("core.noAnswerHint") });
    else if (problem instanceof ApiProblem) announce(problem.detail || String(problem), { kind: "bad", hint: problem.hint });
    else announce(String(problem), { kind: "bad" });
    return null;
  }

  return { region, announce, refused };
}
