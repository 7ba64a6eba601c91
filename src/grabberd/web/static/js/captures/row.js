// One capture in the list: a row on a tablet, a card on a phone.
import { el, fill, symbol } from "../core/dom.js";
import { analysisBadge, analysisIn, badge, channelsBadge, labelsIn, ledgerIn, lengthIn, measuredBadge } from "./words.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture } from "types/documents" */

/** @param {Context} context @param {Capture} capture */
export function createRow(context, capture) {
  const { t, format } = context;
  const link = el("a", { class: "card capture-row", href: `#captures/${encodeURIComponent(capture.id)}` });
  const element = el("li", { data: { capture: capture.id } }, link);
  let shown = "";

  /** Nothing is written anew that has not changed: who reads or touches it is not disturbed. @param {Capture} now */
  function show(now) {
    const text = JSON.stringify(now);
    if (text === shown) return;
    shown = text;
    const found = analysisIn(context, now.analysis);
    fill(
      link, when(now), what(now), el("span", { class: "capture-length number" }, now.state === "armed" ? "" : lengthIn(context, now)), said(now), symbol("next"),
      found && el("span", { class: "capture-found muted small" }, found),
    );
  }

  /** @param {Capture} now */
  function when(now) {
    return el("span", { class: "capture-when" }, el("b", {}, format.time(now.created_utc)), el("span", { class: "muted small" }, format.day(now.created_utc)));
  }

  /** @param {Capture} now */
  function what(now) {
    const labels = labelsIn(context, now);
    const pin = now.pinned && symbol("pin", t("captures.pinned"));
    return el("span", { class: "capture-what" }, el("b", {}, labels || t("captures.unnamed"), pin), now.note && el("span", { class: "capture-note muted small" }, now.note));
  }

  /** @param {Capture} now */
  function said(now) {
    const whole = now.state !== "armed" && !now.ledger.complete;
    return el(
      "span", { class: "capture-said" },
      badge(context, now), measuredBadge(context, now.coverage), channelsBadge(context, now.channels), whole && el("span", { class: "small" }, ledgerIn(context, now)),
      analysisBadge(context, now.analysis),
    );
  }

  show(capture);
  return { element, show };
}
