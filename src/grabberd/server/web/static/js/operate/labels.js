// Labels of the next capture, or of the one that runs or has just ended: name, cow, teat, liner, note.
import { el, setText } from "../core/dom.js";

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
    const input = el("input", { class: "input", maxlength: 80, autocomplete: "off", data: { label: name }, on: { input: () => given(name, input.value) } });
    return input;
  }

  const [name, cow, liner] = ["name", "cow", "liner"].map(text);
  const options = TEATS.map((teat) => el("option", { value: teat }, t(`operate.teats.${teat || "none"}`)));
  const teat = el("select", { class: "input", data: { label: "teat" }, on: { change: () => given("teat", teat.value) } }, options);
  const note = el("textarea", { class: "input", maxlength: 2000, on: { input: () => set("note", note.value) } });
  const title = el("summary", {});
  const hint = el("p", { class: "field-hint", role: "status" });
  const labelled = (/** @type {string} */ key, /** @type {HTMLElement} */ input) => field(t(`operate.labels.${key}`), input);
  const element = el("details", { class: "labels", open: true }, title, hint,
    el("div", { class: "labels-grid" }, labelled("name", name), labelled("cow", cow), labelled("teat", teat), labelled("liner", liner)),
    labelled("note", note));

  return {
    element,
    /** Puts in what the wish holds. */
    fill() {
      for (const input of [name, cow, teat, liner]) input.value = wish.labels[input.dataset.label ?? ""] ?? "";
      note.value = wish.note;
    },
    /** Says which capture they are of, or that it has them. @param {"next" | "running" | "last"} whose @param {boolean} stored */
    tell(whose, stored) {
      setText(title, t(`operate.labels.${whose}.title`));
      setText(hint, t(stored ? "operate.labels.stored" : `operate.labels.${whose}.hint`));
    },
    focus: () => cow.focus(),
  };
}

/** @param {string} label @param {HTMLElement} input */
function field(label, input) {
  return el("label", { class: "field" }, el("span", { class: "field-label" }, label), input);
}
