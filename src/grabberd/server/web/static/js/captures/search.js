// Words that are searched for as they are typed, the order of the list, and the list as a table.
import { el, fill, symbol } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { Question } from "./question.js" */

const PAUSE_MS = 200;
const ORDERS = ["-time", "time", "-length", "-losses", "-size", "label.cow", "label.liner"];

/** @param {Context} context @param {Question} question */
export function createSearch({ t, api }, question) {
  let timer = 0;
  const text = el("input", { class: "input", type: "search", maxlength: 200, autocomplete: "off", enterkeyhint: "search", value: question.get("search"), on: { input: soon } });
  const order = el("select", { class: "input", on: { change: () => question.put("sort", order.value) } });
  const table = el("a", { class: "button", download: "captures.csv" }, symbol("download"), t("captures.table"));
  const element = el(
    "form", { class: "capture-search", role: "search", on: { submit: (event) => event.preventDefault() } },
    el("label", { class: "field grow" }, el("span", { class: "field-label" }, t("captures.search")), text),
    el("label", { class: "field" }, el("span", { class: "field-label" }, t("captures.sort")), order),
    table,
  );

  function soon() {
    clearTimeout(timer);
    timer = setTimeout(() => question.put("search", text.value.trim()), PAUSE_MS);
  }

  /** Shows the question as it stands. */
  function show() {
    const now = question.get("sort");
    fill(order, (ORDERS.includes(now) ? ORDERS : [...ORDERS, now]).map((one) => el("option", { value: one, selected: one === now }, ORDERS.includes(one) ? t(`captures.order.${one.replace(".", "_")}`) : one)));
    if (document.activeElement !== text) text.value = question.get("search");
    table.href = api.url(`/captures.csv?${question.query()}`);
  }

  show();
  return {
    element, show,
    focus() {
      text.focus();
      text.select();
    },
    unmount: () => clearTimeout(timer),
  };
}
