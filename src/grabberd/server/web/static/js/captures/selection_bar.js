// What can be done with the captures that are chosen: label, pin, analyse, take home, delete.
import { el, fill, setText, symbol } from "../core/dom.js";
import { analyse, annotate, remove } from "./batch.js";
import { askLabels } from "./label_question.js";
import { ZONE } from "./question.js";
import { labelsIn } from "./words.js";

/** @import { Context } from "../core/context.js" */
/** @import { Outcome } from "./batch.js" */
/** @import { Selection } from "./selection.js" */
/** @import { Capture } from "types/documents" */

/** As many as one archive holds. */
const MOST_TAKEN = 100;

/**
 * @param {Context} context
 * @param {Selection} selection
 * @param {{reload: () => void, shown: () => Capture[]}} list
 */
export function createSelectionBar(context, selection, list) {
  const { t, tn, may } = context;
  const count = el("strong", { role: "status" });
  const buttons = el("div", { class: "row" });
  const element = el("section", { class: "selection-bar", "aria-label": t("captures.chosen.title"), hidden: true }, count, buttons);
  const report = el("div", { role: "alert" });
  let busy = false;

  function show() {
    element.hidden = !selection.size();
    if (busy) return;
    setText(count, tn("captures.chosen.count", selection.size()));
    const all = selection.all();
    const pin = all.some((one) => !one.pinned);
    const few = selection.size() <= MOST_TAKEN;
    fill(
      buttons,
      may("operator") && button("label", "measure", label),
      may("operator") && button(pin ? "pin" : "unpin", "pin", () => act(pin ? "pinned" : "unpinned", (progress) => annotate(context, all, { pinned: pin }, progress))),
      may("operator") && button("analyse", "analysis", () => act("queued", (progress) => analyse(context, all, progress))),
      selection.size() > 1 && el("a", { class: "button", href: `#compare/${all.map(({ id }) => encodeURIComponent(id)).join()}`, data: { do: "compare" } }, symbol("compare"), t("captures.compare")),
      few ? el("a", { class: "button", href: address(all), download: "captures.zip", data: { do: "take" } }, symbol("download"), t("captures.chosen.take")) : el("span", { class: "muted small" }, t("captures.chosen.most", { n: MOST_TAKEN })),
      may("operator") && button("delete", "delete", ask),
      list.shown().some((one) => !selection.has(one.id)) && button("all", "ok", () => selection.add(list.shown())),
      button("none", "close", selection.clear),
    );
  }

  /** @param {string} key @param {string} sign @param {() => void} act */
  const button = (key, sign, act) => el("button", { class: "button", type: "button", data: { do: key }, on: { click: act } }, symbol(sign), t(`captures.chosen.${key}`));

  /** @param {Capture[]} captures */
  const address = (captures) => context.api.url(`/captures.zip?${new URLSearchParams([["zone", ZONE], ...captures.map((one) => ["capture", one.id])])}`);

  async function label() {
    const change = await askLabels(context, selection.size());
    if (change) await act("labelled", (progress) => annotate(context, selection.all(), change, progress));
  }

  async function ask() {
    const all = selection.all();
    const pinned = all.filter((one) => one.pinned).length;
    const text = pinned ? tn("captures.chosen.pinnedStay", pinned) : "";
    if (await context.confirm({ title: tn("captures.chosen.deleteTitle", all.length), text, action: tn("captures.chosen.deleteDo", all.length - pinned), danger: true })) await act("deleted", (progress) => remove(context, all, progress), true);
  }

  /** Shows at once that it has begun, and in the end what came of it. @param {string} key @param {(progress: (done: number) => void) => Promise<Outcome>} work @param {boolean} [gone] true if what is done is no longer there */
  async function act(key, work, gone = false) {
    const all = selection.all();
    const progress = (/** @type {number} */ done) => setText(count, t("captures.chosen.progress", { done, of: all.length }));
    busy = true;
    for (const one of buttons.querySelectorAll("button")) one.disabled = true;
    progress(0);
    fill(report);
    try {
      const { done, failed } = await work(progress);
      if (done.length) context.announce(tn(`captures.chosen.${key}`, done.length), { kind: "good" });
      if (failed.length) fill(report, failures(all, failed));
      if (gone) selection.remove(done);
    } catch (problem) {
      context.refused(problem);
    } finally {
      busy = false;
      show();
      list.reload();
    }
  }

  /** @param {Capture[]} all @param {Outcome["failed"]} failed */
  function failures(all, failed) {
    const named = (/** @type {string} */ id) => {
      const one = all.find((capture) => capture.id === id);
      return one ? [labelsIn(context, one) || t("captures.unnamed"), context.format.when(one.created_utc)].join(" · ") : id;
    };
    const close = el("button", { class: "button plain icon", type: "button", "aria-label": t("core.close"), on: { click: () => fill(report) } }, symbol("close"));
    return el("div", { class: "note is-warn" }, symbol("warn"), el("div", { class: "grow" }, el("strong", {}, tn("captures.chosen.failed", failed.length)), el("ul", { class: "selection-failures" }, failed.map(({ capture, detail, hint }) => el("li", {}, el("b", {}, named(capture)), ` – ${detail}. `, el("span", { class: "muted" }, hint))))), close);
  }

  return { element, report, show };
}
