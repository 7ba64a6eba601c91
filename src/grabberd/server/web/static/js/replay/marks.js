// Marks of a capture: fields with a name, kept by the daemon, for everybody who looks at it.
import { periodOf } from "../captures/words.js";
import { el, fill, symbol } from "../core/dom.js";
import { draftOf, keepDraft } from "../core/drafts.js";
import { pathOf } from "./source.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture } from "types/documents" */

/**
 * @param {Context} context
 * @param {object} about
 * @param {string} about.id of the capture
 * @param {() => number} about.at field of the playhead
 * @param {(n: number) => void} about.go
 * @param {(capture: Capture) => void} about.changed
 */
export function createMarks(context, { id, at, go, changed }) {
  const { t, api, may, format } = context;
  const list = el("ul", { class: "replay-marks" });
  const draft = `mark.${id}`;
  let field_s = 0;
  const name = el("input", { class: "input", maxlength: 200, value: draftOf(draft)?.name ?? "", on: { input: () => keepDraft(draft, { name: name.value }) }, autocomplete: "off", "aria-label": t("replay.marks.name"), placeholder: t("replay.marks.name") });
  const set = el("button", { class: "button", type: "submit", data: { do: "mark" } }, symbol("pin"), t("replay.marks.set"));
  const form = el("form", { class: "row replay-mark", hidden: !may("operator"), on: { submit: add } }, el("div", { class: "grow" }, name), set);
  const none = el("p", { class: "muted" }, t("replay.marks.none"));
  const element = el("section", { class: "card stack", "aria-label": t("replay.marks.title") }, el("h2", {}, t("replay.marks.title")), form, none, list);

  /** @param {Event} event */
  async function add(event) {
    event.preventDefault();
    const n = at();
    const given = name.value.trim() || t("replay.marks.unnamed", { n });
    set.disabled = true;
    if (await send({ [n]: given })) {
      name.value = "";
      keepDraft(draft, null);
    }
    set.disabled = false;
  }

  /** @param {Record<string, string | null>} marks */
  async function send(marks) {
    const now = await api.patch(pathOf(id), { body: { marks } }).catch(context.refused);
    if (now) changed(now);
    return Boolean(now);
  }

  /** @param {NonNullable<Capture["marks"]>[number]} mark */
  function line(mark) {
    const words = t("replay.marks.at", { name: mark.name, n: mark.n, s: format.number(mark.n * field_s, 2) });
    const remove = el("button", { class: "button icon", type: "button", "aria-label": t("replay.marks.remove", { name: mark.name }), title: t("replay.marks.remove", { name: mark.name }), on: { click: () => drop(mark.n, remove) } }, symbol("delete"));
    return el("li", { class: "row between" }, el("button", { class: "button plain grow", type: "button", data: { mark: mark.n }, on: { click: () => go(mark.n) } }, words), may("operator") && remove);
  }

  /** @param {number} n @param {HTMLButtonElement} button */
  async function drop(n, button) {
    button.disabled = true;
    await send({ [n]: null });
    button.disabled = false;
  }

  return {
    element,
    /** @param {Capture} capture */
    show(capture) {
      const marks = capture.marks ?? [];
      field_s = periodOf(capture);
      none.hidden = marks.length > 0;
      fill(list, ...marks.map(line));
    },
  };
}
