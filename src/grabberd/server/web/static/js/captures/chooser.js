// Choice of one capture among all: searched as it is typed, in words first.
import { el, fill, setText, symbol } from "../core/dom.js";
import { atRest, lineOf } from "./words.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture } from "types/documents" */

const SHOWN = 20;
const PAUSE_MS = 150;
let made = 0;

/**
 * @typedef {object} Wanted
 * @property {string} label
 * @property {Record<string, string>} [query] which captures it offers, beside what is typed
 * @property {string} [none] words for choosing none of them, such as what is seen now
 * @property {(id: string, capture: Capture | null) => void} choose told of another choice; "" for none
 */

/** @param {Context} context @param {Wanted} wanted @param {string} [chosen] id */
export function createChooser(context, { label, query = {}, none = "", choose }, chosen = "") {
  const { t, tn, api } = context;
  const id = `chooser-${(made += 1)}`;
  const list = el("ul", { class: "chooser-list", role: "listbox", id: `${id}-list`, "aria-label": t("captures.title"), hidden: true });
  const said = el("span", { class: "visually-hidden", "aria-live": "polite" });
  const input = el("input", {
    class: "input", id, role: "combobox", autocomplete: "off", "aria-expanded": "false", "aria-controls": `${id}-list`, "aria-autocomplete": "list", placeholder: t("captures.chooser.hint"), data: { chooser: "" },
    on: { input: soon, focus: open, click: open, blur: () => setTimeout(close, 150), keydown: press },
  });
  const element = el("div", { class: "field chooser" }, el("label", { class: "field-label", for: id }, label), el("div", { class: "chooser-place" }, input, symbol("search")), list, said);
  /** @type {{id: string, capture: Capture | null, words: string}[]} */
  let offered = [];
  let at = -1;
  let timer = 0;
  let turn = 0;
  let words = none;

  function soon() {
    clearTimeout(timer);
    timer = setTimeout(() => look(input.value.trim()), PAUSE_MS);
  }

  function open() {
    if (!list.hidden) return;
    input.select();
    look("");
  }

  /** @param {string} text */
  async function look(text) {
    const mine = ++turn;
    const asked = new URLSearchParams({ measured: "true", ...query, limit: String(SHOWN), ...(text ? { search: text } : {}) });
    const page = await api.get(`/captures?${asked}`).catch(context.refused);
    if (mine !== turn || !page || document.activeElement !== input) return;
    const first = none && !text ? [{ id: "", capture: null, words: none }] : [];
    offered = [...first, ...page.captures.filter(atRest).map((one) => ({ id: one.id, capture: one, words: lineOf(context, one) }))];
    at = Math.max(0, offered.findIndex((one) => one.id === chosen));
    fill(list, ...offered.map(option), page.total > SHOWN ? el("li", { class: "muted small chooser-more", role: "presentation" }, tn("captures.chooser.more", page.total - SHOWN)) : null, offered.length ? null : el("li", { class: "muted chooser-more", role: "presentation" }, t("captures.nothing")));
    setText(said, tn("captures.shown", page.total));
    list.hidden = false;
    input.setAttribute("aria-expanded", "true");
    mark();
  }

  /** @param {typeof offered[number]} one @param {number} i */
  function option(one, i) {
    const made = el("li", { role: "option", id: `${id}-${i}`, class: "chooser-option", data: { choice: one.id } }, el("span", {}, one.words), one.id && el("span", { class: "capture-id muted" }, one.id));
    // Before the input loses the focus, which closes the list.
    made.addEventListener("pointerdown", (event) => event.preventDefault());
    made.addEventListener("click", () => take(one));
    return made;
  }

  function mark() {
    [...list.querySelectorAll(".chooser-option")].forEach((one, i) => one.setAttribute("aria-selected", String(i === at)));
    if (offered[at]) input.setAttribute("aria-activedescendant", `${id}-${at}`);
    else input.removeAttribute("aria-activedescendant");
    list.children[at]?.scrollIntoView({ block: "nearest" });
  }

  /** @param {KeyboardEvent} event */
  function press(event) {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (step && list.hidden) open();
    else if (step) at = Math.min(offered.length - 1, Math.max(0, at + step));
    else if (event.key === "Enter" && offered[at] && !list.hidden) take(offered[at]);
    else if (event.key === "Escape" && !list.hidden) close();
    else return;
    event.preventDefault();
    mark();
  }

  /** @param {typeof offered[number]} one */
  function take(one) {
    const other = one.id !== chosen;
    [chosen, words] = [one.id, one.words];
    close();
    if (other) choose(one.id, one.capture);
  }

  function close() {
    turn += 1;
    clearTimeout(timer);
    list.hidden = true;
    input.setAttribute("aria-expanded", "false");
    input.removeAttribute("aria-activedescendant");
    input.value = words;
  }

  /** Shows a choice that was made elsewhere. @param {string} now id */
  async function show(now) {
    chosen = now;
    words = now || none;
    close();
    const capture = now ? await api.get(`/captures/${encodeURIComponent(now)}`).catch(() => null) : null;
    if (capture && chosen === now) {
      words = lineOf(context, capture);
      if (list.hidden) input.value = words;
    }
  }

  show(chosen);
  return { element, show, value: () => chosen };
}
