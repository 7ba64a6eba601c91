// Labels and note of a capture. Operators change them; the file stays as it was recorded.
import { draftOf, keepDraft, resumedNote } from "../core/drafts.js";
import { el, fill } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture } from "types/documents" */

const USUAL = ["name", "cow", "teat", "liner"];
const TEATS = ["", "front left", "front right", "rear left", "rear right"];

/** @param {Context} context @param {(capture: Capture) => void} changed */
export function createLabels(context, changed) {
  const { t, texts, api, may } = context;
  const body = el("div", { class: "stack" });
  const element = el("section", { class: "card" }, el("h2", {}, t("capture.said.title")), body);
  let shown = "";
  let dirty = false;

  /** Nothing is taken away from who is writing. @param {Capture} capture */
  function show(capture) {
    const text = JSON.stringify([capture.labels, capture.note]);
    if (dirty || text === shown) return;
    shown = text;
    fill(body, may("operator") ? form(capture) : facts(capture));
  }

  /** @param {string} name */
  const wordFor = (name) => (texts.has(`operate.labels.${name}`) ? t(`operate.labels.${name}`) : name);

  /** @param {Capture} capture */
  function facts(capture) {
    const all = [...Object.entries(capture.labels).map(([name, value]) => [wordFor(name), value]), ...(capture.note ? [[t("operate.labels.note"), capture.note]] : [])];
    if (!all.length) return el("p", { class: "muted" }, t("capture.said.nothing"));
    return el("dl", { class: "facts" }, all.map(([name, value]) => [el("dt", {}, name), el("dd", {}, value)]));
  }

  /** @param {Capture} capture */
  function form(capture) {
    const names = [...USUAL, ...Object.keys(capture.labels).filter((name) => !USUAL.includes(name))];
    const inputs = Object.fromEntries(names.map((name) => [name, inputFor(name, capture.labels[name] ?? "")]));
    const newName = el("input", { class: "input", maxlength: 80, autocomplete: "off" });
    const newValue = el("input", { class: "input", maxlength: 200, autocomplete: "off" });
    const note = el("textarea", { class: "input", maxlength: 2000, value: capture.note });
    const draft = `labels.${capture.id}`;
    const typed = { ...Object.fromEntries(names.map((name) => [`label ${name}`, inputs[name]])), newName, newValue, note };
    const save = el("button", { class: "button primary", type: "submit", disabled: true, data: { do: "save" } }, t("capture.said.save"));

    /** @param {Event} event */
    async function send(event) {
      event.preventDefault();
      const given = Object.entries(inputs).map(([name, input]) => [name, input.value.trim()]);
      const labels = Object.fromEntries([...given, [newName.value.trim(), newValue.value.trim()]].filter(([name, value]) => name && value !== (capture.labels[name] ?? "")).map(([name, value]) => [name, value || null]));
      save.disabled = true;
      try {
        const now = await api.patch(`/captures/${encodeURIComponent(capture.id)}`, { body: { note: note.value.trim(), labels } });
        dirty = false;
        keepDraft(draft, null);
        context.announce(t("capture.said.saved"), { kind: "good" });
        changed(now);
      } catch (problem) {
        save.disabled = false;
        context.refused(problem);
      }
    }

    const touched = () => {
      dirty = true;
      save.disabled = false;
      keepDraft(draft, Object.fromEntries(Object.entries(typed).map(([name, input]) => [name, input.value])));
    };

    /** Goes on with what was typed before. */
    function resume() {
      const before = draftOf(draft);
      if (!before) return null;
      for (const [name, input] of Object.entries(typed)) input.value = before[name] ?? input.value;
      touched();
      return resumedNote(context, draft, () => {
        dirty = false;
        fill(body, form(capture));
      });
    }

    return el("form", { class: "stack", on: { submit: send, input: touched } }, resume(),
      el("div", { class: "capture-labels" }, names.map((name) => field(wordFor(name), inputs[name]))),
      el("details", {}, el("summary", { class: "capture-summary" }, t("capture.said.another")), el("div", { class: "capture-labels" }, field(t("capture.said.newName"), newName), field(t("capture.said.newValue"), newValue))),
      field(t("operate.labels.note"), note),
      el("div", { class: "row end" }, save));
  }

  /** @param {string} name @param {string} value */
  function inputFor(name, value) {
    if (name !== "teat") return el("input", { class: "input", maxlength: 200, autocomplete: "off", value, data: { label: name } });
    const options = [...new Set([...TEATS, value])];
    return el("select", { class: "input", data: { label: name } }, options.map((teat) => el("option", { value: teat, selected: teat === value }, TEATS.includes(teat) ? t(`operate.teats.${teat || "none"}`) : teat)));
  }
  return { element, show };
}

/** @param {string} label @param {HTMLElement} input */
const field = (label, input) => el("label", { class: "field" }, el("span", { class: "field-label" }, label), input);
