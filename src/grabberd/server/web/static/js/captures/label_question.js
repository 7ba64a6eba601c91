// Labels for several captures: what is left empty stays as it is with each of them.
import { el } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { CapturesPatch } from "types/documents" */

const TEATS = ["", "front left", "front right", "rear left", "rear right"];

/** Asks; null where nothing is to be changed. @param {Context} context @param {number} count @returns {Promise<Pick<CapturesPatch, "labels" | "note"> | null>} */
export async function askLabels({ t, tn, confirm }, count) {
  const input = () => el("input", { class: "input", maxlength: 200, autocomplete: "off" });
  const [cow, liner, note] = [input(), input(), input()];
  const teat = el("select", { class: "input" }, TEATS.map((one) => el("option", { value: one }, t(`operate.teats.${one || "none"}`))));
  const field = (/** @type {string} */ name, /** @type {HTMLElement} */ control) => el("label", { class: "field" }, el("span", { class: "field-label" }, t(`operate.labels.${name}`)), control);
  const body = el("div", { class: "capture-labels" }, field("cow", cow), field("teat", teat), field("liner", liner), field("note", note));
  const wanted = await confirm({ title: tn("captures.chosen.labelTitle", count), text: t("captures.chosen.labelHint"), body, action: t("captures.chosen.labelDo") });
  const labels = Object.fromEntries(Object.entries({ cow: cow.value.trim(), teat: teat.value, liner: liner.value.trim() }).filter(([, value]) => value));
  if (!wanted || !(Object.keys(labels).length || note.value.trim())) return null;
  return { labels, ...(note.value.trim() ? { note: note.value.trim() } : {}) };
}
