// Labels of the next capture: name, cow, teat, liner, note.
import { el } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { Change, Wish } from "./wish.js" */

const TEATS = ["", "front left", "front right", "rear left", "rear right"];

/**
 * @param {Context} context
 * @param {Wish} wish
 * @param {Change} set
 */
export function createLabels({ t }, wish, set) {
  /** @param {string} name @param {string} value */
  const given = (name, value) => set("labels", { ...wish.labels, [name]: value });

  /** @param {string} name */
  function text(name) {
    const input = el("input", { class: "input", maxlength: 80, autocomplete: "off", value: wish.labels[name] ?? "", data: { label: name }, on: { input: () => given(name, input.value) } });
    return field(t(`operate.labels.${name}`), input);
  }

  const options = TEATS.map((teat) =>
    el("option", { value: teat, selected: teat === (wish.labels.teat ?? "") }, t(`operate.teats.${teat || "none"}`)),
  );
  const teat = el("select", { class: "input", data: { label: "teat" }, on: { change: () => given("teat", teat.value) } }, options);
  const note = el("textarea", { class: "input", maxlength: 2000, on: { input: () => set("note", note.value) } });
  return el("details", { class: "labels", open: true },
    el("summary", {}, t("operate.labels.title")),
    el("p", { class: "field-hint" }, t("operate.labels.hint")),
    el("div", { class: "labels-grid" }, text("name"), text("cow"), field(t("operate.labels.teat"), teat), text("liner")),
    field(t("operate.labels.note"), note),
  );
}

/** @param {string} label @param {HTMLElement} input */
function field(label, input) {
  return el("label", { class: "field" }, el("span", { class: "field-label" }, label), input);
}
