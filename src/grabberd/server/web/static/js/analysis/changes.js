// A value changed for this analysis: folded away, filled in with what is known, kept until the analysis is made.
import { el, fill, symbol } from "../core/dom.js";
import { createBursts } from "./bursts.js";
import { draftOf, keepDraft } from "./draft.js";
import { createForm } from "./form.js";
import { inputsOf, valuesOf } from "./inputs.js";

/** @import { Context } from "../core/context.js" */
/** @import { AnalysisPreparation, AnalysisRow, Capture } from "types/documents" */
/** @import { AnalysisInputs } from "types/open_documents" */
/** @import { Values } from "./inputs.js" */

/** @param {Context} context @param {Capture} capture @param {AnalysisRow[]} own its analyses @param {() => void} changed */
export function createChanges(context, capture, own, changed) {
  const { t } = context;
  const draft = draftOf(capture.id);
  /** What the form would say if nothing had been changed in it. @type {Values} */
  let known = draft?.known ?? {};
  let isChanged = Boolean(draft);
  let filling = true;
  const profiles = el("input", { type: "checkbox", checked: draft?.profiles ?? true, data: { asked: "profiles" }, on: { change: typed } });
  const offer = el("div", { class: "stack" });
  const undo = el("button", { class: "button", type: "button", hidden: !draft, data: { do: "undo" }, on: { click: forget } }, t("analysis.change.undo"));
  const left = el("p", { class: "field-hint", hidden: true });
  const form = createForm(context, typed);
  const run = el("select", { class: "input", id: "analysis-run", on: { change: changed } }, capture.runs.map((one) => el("option", { value: one.run, selected: one === capture.runs.at(-1) }, t("analysis.run", { n: one.run }))));
  const runs = el("label", { class: "field", hidden: capture.runs.length < 2 }, el("span", { class: "field-label" }, t("analysis.change.run")), run);
  const bursts = createBursts(context, capture);
  const element = el("details", { class: "analysis-change", open: Boolean(draft) }, el("summary", { class: "capture-summary" }, t("analysis.change.title")),
    el("div", { class: "stack" }, undo, offer, left, el("label", { class: "check" }, profiles, t("analysis.change.profiles")), runs, form.element, bursts.element));
  function typed() {
    if (filling) return;
    isChanged = true;
    undo.hidden = false;
    keepDraft(capture.id, { values: form.values(), known, profiles: profiles.checked });
    changed();
  }

  /** @param {Values} values */
  function set(values) {
    filling = true;
    form.set(values);
    filling = false;
  }

  function forget() {
    isChanged = false;
    undo.hidden = true;
    left.hidden = true;
    profiles.checked = true;
    keepDraft(capture.id, null);
    set({});
    changed();
  }

  /** Fills in what is known, as long as nothing has been changed. @param {AnalysisPreparation} found */
  function show(found) {
    if (isChanged) return;
    const { values, dropped } = valuesOf(/** @type {AnalysisInputs} */ (found.inputs));
    known = values;
    set(values);
    sayDropped(dropped);
  }

  /** @param {string[]} dropped */
  function sayDropped(dropped) {
    left.hidden = !dropped.length;
    fill(left, dropped.map((what) => t(`analysis.take.dropped.${what}`)).join(" "));
  }

  /** Inputs that differ from what is known: those win, and the daemon fills in the rest; without it all of them. */
  function given() {
    if (!profiles.checked) return inputsOf(form.values());
    if (!isChanged) return {};
    const [now, before] = [inputsOf(form.values()), inputsOf(known)];
    return Object.fromEntries(Object.entries(now).filter(([name, value]) => JSON.stringify(value) !== JSON.stringify(/** @type {Record<string, unknown>} */ (before)[name])));
  }

  /** Inputs of the last analysis are taken over by a press, and seen before they are used. */
  function offerLast() {
    const last = own.find((one) => !one.problem && Object.keys(one.inputs ?? {}).length > 0);
    if (!last) return;
    const { values, dropped } = valuesOf(/** @type {AnalysisInputs} */ (last.inputs ?? {}));
    const take = () => {
      set(values);
      sayDropped(dropped);
      typed();
    };
    fill(offer, el("button", { class: "button", type: "button", data: { do: "take-over" }, on: { click: take } }, symbol("down"), t("analysis.take.own", { n: last.analysis })));
  }

  if (draft) set(draft.values);
  filling = false;
  offerLast();
  return {
    element, show,
    missing: form.missing,
    isChanged: () => isChanged,
    request() {
      const { vacuum_log } = form.request();
      return { inputs: given(), ...(vacuum_log ? { vacuum_log } : {}), bursts: bursts.chosen(), run: Number(run.value) || null, profiles: profiles.checked, configured: profiles.checked };
    },
  };
}
