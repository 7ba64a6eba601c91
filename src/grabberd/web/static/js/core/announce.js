// Short messages: seen for a while at the edge of the page, and read aloud.
import { el, symbol } from "./dom.js";

const SHOWN_MS = 8000;
const SYMBOLS = { info: "info", good: "ok", bad: "bad" };

/** @param {(key: string) => string} t */
export function createAnnouncer(t) {
  const region = el("div", { class: "toasts", role: "status", "aria-live": "polite" });

  /**
   * Says something.
   * @param {string} text
   * @param {{kind?: "info" | "good" | "bad", hint?: string}} [options] what is bad stays until it is closed
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

  /** Says what a request was refused with. @param {any} problem */
  function refused(problem) {
    if (problem?.name === "AbortError") return;
    if (problem?.status === 0) announce(t("core.noAnswer"), { kind: "bad", hint: t("core.noAnswerHint") });
    else announce(problem?.detail || String(problem), { kind: "bad", hint: problem?.hint });
  }

  return { region, announce, refused };
}
