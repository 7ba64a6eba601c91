// Search for captures: by text, by day.
import { el, symbol } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */

const PAUSE_MS = 300;

/** @param {Context} context @param {() => void} changed */
export function createSearch({ t, api }, changed) {
  let timer = 0;
  const text = el("input", { class: "input", type: "search", maxlength: 200, autocomplete: "off", on: { input: soon } });
  const day = el("input", { class: "input", type: "date", on: { change: changed } });
  const all = el("button", { class: "button", type: "button", on: { click: clear } }, t("captures.all"));
  const table = el("a", { class: "button", download: "captures.csv" }, symbol("download"), t("captures.table"));
  const element = el(
    "form", { class: "capture-search", role: "search", on: { submit: (event) => event.preventDefault() } },
    el("label", { class: "field grow" }, el("span", { class: "field-label" }, t("captures.search")), text),
    el("label", { class: "field" }, el("span", { class: "field-label" }, t("captures.day")), day),
    all,
    table,
  );

  function soon() {
    clearTimeout(timer);
    timer = setTimeout(changed, PAUSE_MS);
  }

  function clear() {
    text.value = day.value = "";
    changed();
  }

  /** The query's part of the address. */
  function query() {
    all.hidden = !isNarrow();
    const parts = new URLSearchParams();
    if (text.value.trim()) parts.set("search", text.value.trim());
    if (day.value) for (const [name, utc] of Object.entries(boundsOf(day.value))) parts.set(name, utc);
    table.href = api.url(`/captures.csv?${parts}`);
    return parts;
  }
  const isNarrow = () => Boolean(text.value.trim() || day.value);
  return { element, query, isNarrow };
}

/** From midnight to midnight, by this tablet's clock. @param {string} day "2026-03-01" */
function boundsOf(day) {
  const [year, month, date] = day.split("-").map(Number);
  return { since: new Date(year, month - 1, date).toISOString(), until: new Date(year, month - 1, date + 1).toISOString() };
}
