// One capture in the list: picture and curve, words, verdicts; a row on a tablet, a card on a phone.
import { el, fill, setText, symbol } from "../core/dom.js";
import { createSparkline } from "./sparkline.js";
import { analysisBadge, analysisIn, badge, channelsBadge, labelsIn, ledgerIn, lengthIn, measuredBadge } from "./words.js";

/** @import { Context } from "../core/context.js" */
/** @import { Selection } from "./selection.js" */
/** @import { Capture } from "types/documents" */

/** @param {Context} context @param {Capture} capture @param {Selection} selection */
export function createRow(context, capture, selection) {
  const { t, format } = context;
  const link = el("a", { class: "card capture-row", href: `#captures/${encodeURIComponent(capture.id)}` });
  const box = el("input", { type: "checkbox", on: { change: () => selection.set(now, box.checked) } });
  const name = el("span", { class: "visually-hidden" });
  const mark = el("label", { class: "capture-mark" }, box, name);
  const element = el("li", { class: "capture-item", data: { capture: capture.id } }, mark, link);
  let now = capture;
  let shown = "";

  /** Nothing is written anew that has not changed: who reads or touches it is not disturbed. @param {Capture} next */
  function show(next) {
    const text = JSON.stringify(next);
    if (text === shown) return;
    shown = text;
    now = next;
    const found = analysisIn(context, now.analysis);
    fill(link, picture(), what(), said(), found && el("span", { class: "capture-found muted small" }, found));
    setText(name, t("captures.select", { what: labelsIn(context, now) || format.when(now.created_utc) }));
  }

  function picture() {
    const sealed = now.state === "sealed" && now.fields > 0;
    const source = context.api.url(`/captures/${encodeURIComponent(now.id)}/thumbnail.png`);
    // A file that has been damaged since has no picture: its place stays empty, and the badge says why.
    const image = sealed && el("img", { src: source, alt: "", width: 180, height: 144, loading: "lazy", decoding: "async", on: { error: () => image && image.remove() } });
    return el("span", { class: "capture-thumb" }, image);
  }

  function what() {
    const labels = labelsIn(context, now);
    const pin = now.pinned && symbol("pin", t("captures.pinned"));
    return el("span", { class: "capture-what" },
      el("b", {}, labels || t("captures.unnamed"), pin),
      el("span", {}, format.when(now.created_utc), now.state === "armed" ? "" : el("span", { class: "muted number" }, ` · ${lengthIn(context, now)}`)),
      now.note && el("span", { class: "capture-note muted small" }, now.note),
      el("span", { class: "capture-id muted" }, now.id));
  }

  function said() {
    const whole = now.state !== "armed" && !now.ledger.complete;
    return el(
      "span", { class: "capture-said" },
      createSparkline(context, now),
      badge(context, now), measuredBadge(context, now.coverage), channelsBadge(context, now.channels), whole && el("span", { class: "small" }, ledgerIn(context, now)),
      analysisBadge(context, now.analysis),
    );
  }

  show(capture);
  return {
    element, show,
    /** Shows whether it is chosen. */
    mark: () => (box.checked = selection.has(now.id)),
    focus: () => link.focus(),
  };
}
