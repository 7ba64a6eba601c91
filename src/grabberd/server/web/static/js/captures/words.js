// A capture in words.
import { el, symbol } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture, CaptureAnalysis, Coverage, LedgerEntry, LedgerEvent, Quantity } from "types/documents" */

/** Level and symbol. @type {Record<string, [string, string]>} */
const LOOKS = {
  complete: ["good", "ok"], incomplete: ["warn", "warn"], damaged: ["bad", "bad"], unsealed: ["warn", "warn"],
  armed: ["busy", "armed"], recording: ["busy", "capturing"], sealing: ["idle", "wait"],
};
const FIRST = ["name", "cow", "teat", "liner"];
const NAMED = [...FIRST, "note"];

/** The verdict of a sealed capture; of any other its state. @param {Capture} capture */
export function verdictOf(capture) {
  return capture.state === "sealed" && capture.verdict ? capture.verdict : capture.state;
}

/** True if nothing more happens to it by itself. @param {Capture} capture */
export function atRest(capture) {
  return !["armed", "recording", "sealing"].includes(capture.state);
}

/** @param {Context} context @param {Capture} capture */
export function badge({ t }, capture) {
  const verdict = verdictOf(capture);
  const [level, sign] = LOOKS[verdict] ?? ["idle", "unknown"];
  return el("span", { class: `badge is-${level}`, data: { verdict } }, symbol(sign), t(`captures.verdict.${verdict}`));
}

/** Level and symbol. @type {Record<Coverage["verdict"], [string, string]>} */
const MEASURED = { measured_well: ["good", "ok"], measured_with_gaps: ["warn", "warn"], not_measured: ["bad", "bad"] };

/** How well it was measured; nothing where nothing was to be. @param {Context} context @param {Coverage | null | undefined} coverage */
export function measuredBadge({ t }, coverage) {
  if (!coverage) return null;
  const [level, sign] = MEASURED[coverage.verdict];
  return el("span", { class: `badge is-${level}`, data: { measured: coverage.verdict } }, symbol(sign), t(`captures.measured.${coverage.verdict}`));
}

/** How well what was measured beside the picture was recorded; nothing where nothing was to be, or while it records. @param {Context} context @param {Capture["channels"]} channels */
export function channelsBadge({ t }, channels) {
  if (!channels?.verdict) return null;
  const whole = channels.verdict === "complete";
  return el("span", { class: `badge is-${whole ? "good" : "warn"}`, title: channels.in_words, data: { channels: channels.verdict } }, symbol(whole ? "ok" : "warn"), t(`captures.channels.${whole ? "whole" : "gaps"}`));
}

/** Level and symbol. @type {Record<CaptureAnalysis["state"], [string, string]>} */
const ANALYSED = { queued: ["idle", "wait"], running: ["busy", "wait"], done: ["good", "ok"], failed: ["warn", "warn"], cancelled: ["idle", "close"] };

/** Its latest analysis; nothing where none was asked for. @param {Context} context @param {CaptureAnalysis | null | undefined} analysis */
export function analysisBadge({ t }, analysis) {
  if (!analysis) return null;
  const [level, sign] = ANALYSED[analysis.state];
  return el("span", { class: `badge is-${level}`, data: { analysis: analysis.state } }, symbol(sign), t(`captures.analysis.${analysis.state}`));
}

/** What was found, "compression 11.8 ± 1.1 kPa · 60.2 a minute", or why nothing was. @param {Context} context @param {CaptureAnalysis | null | undefined} analysis */
export function analysisIn(context, analysis) {
  if (!analysis) return "";
  if (analysis.problem) return analysis.problem.message;
  return (analysis.quantities ?? []).map((one) => quantityIn(context, one)).join(" · ");
}

/** @param {Context} context @param {Quantity} quantity */
const quantityIn = (context, quantity) => context.t(`captures.analysis.${quantity.name}`, { value: spreadIn(context, quantity) });

/** Value with its σ, to two digits of that: "4.652 ± 0.018". @param {Context} context @param {Pick<Quantity, "value" | "sigma">} quantity */
export function spreadIn({ format }, { value, sigma }) {
  const digits = sigma ? Math.max(0, 1 - Math.floor(Math.log10(sigma))) : 2;
  return `${format.number(value ?? null, digits)}${sigma ? ` ± ${format.number(sigma, digits)}` : ""}`;
}

/** A finding as a sentence. @param {Context} context @param {Coverage["findings"][number]} finding */
export function findingIn({ t, texts, format }, { code, values, miss, in_words }) {
  if (!texts.has(`captures.finding.${code}`)) return in_words;
  const percent = (/** @type {number | null | undefined} */ share) => format.number(Math.floor(100 * (share ?? 0)), 0);
  const whole = (/** @type {number | null | undefined} */ count) => format.number(count ?? 0, 0);
  const target = code === "targets_missed";
  const displaced = target && miss === "off_place" && values.displaced_mm ? t("captures.miss.displaced", { mm: format.number(values.displaced_mm, 1) }) : "";
  return t(`captures.finding.${code}`, {
    share: percent(values.share), apart: percent(values.apart), sigma: format.number(values.residual_sigma ?? null, 1),
    missing: whole(values.missing), fields: whole(values.fields), poor: whole(values.poor), targets: whole(values.targets),
    target: whole(values.target), why: displaced || t(`captures.${target ? "miss" : "missAll"}.${miss}`),
  });
}

/** Its labels: "Cow 112 · Front left · new". @param {Context} context @param {Pick<Capture, "labels">} capture */
export function labelsIn(context, capture) {
  const { labels } = capture;
  const others = Object.keys(labels).filter((name) => !FIRST.includes(name));
  const named = [...FIRST.filter((name) => labels[name]), ...others];
  return named.map((name) => labelIn(context, name, labels[name])).join(" · ");
}

/** @param {Context} context @param {string} name @param {string} value */
function labelIn(context, name, value) {
  const said = labelValueIn(context, name, value);
  return name === "name" || name === "teat" ? said : `${labelNameIn(context, name)} ${said}`;
}

/** A label's name: "Cow". @param {Context} context @param {string} name @returns {string} */
export const labelNameIn = ({ t }, name) => (NAMED.includes(name) ? t(`operate.labels.${name}`) : name);

/** A label's value: teats have words. @param {Context} context @param {string} name @param {string} value */
export const labelValueIn = ({ t, texts }, name, value) => (name === "teat" && texts.has(`operate.teats.${value}`) ? t(`operate.teats.${value}`) : value);

/** A capture in a line: "Cow 112 · Front left · today 14:05, slipped". @param {Context} context @param {Pick<Capture, "labels" | "note" | "created_utc">} capture */
export function lineOf(context, capture) {
  return [labelsIn(context, capture), context.format.instant(capture.created_utc), capture.note].filter(Boolean).join(" · ");
}

/** The time that an id such as 20260301T093000125Z-barn begins with, in words; an id of another kind as it is. @param {string} id @param {(utc: string) => string} words */
export function instantOf(id, words) {
  const found = /^(\d{4})(\d\d)(\d\d)T(\d\d)(\d\d)(\d\d)/.exec(id);
  if (!found) return id;
  const [, year, month, day, hour, minute, second] = found;
  return words(`${year}-${month}-${day}T${hour}:${minute}:${second}Z`);
}

/** Number of fields that should have come so far. @param {Capture} capture */
export function totalOf(capture) {
  return Object.values(capture.ledger.counts).reduce((sum, count) => sum + count, 0);
}

/** Nominal time in s from one field to the next, which a ledger counts by; 0 where nobody knows it. @param {Capture} capture */
export function periodOf({ rate_hz }) {
  return rate_hz ? 1 / rate_hz : 0;
}

/** "5.0 s · 250 fields". @param {Context} context @param {Capture} capture */
export function lengthIn({ t, tn, format }, capture) {
  const total = totalOf(capture);
  const seconds = total * periodOf(capture);
  return `${seconds < 60 ? t("captures.seconds", { s: format.number(seconds, 1) }) : format.duration(seconds)} · ${tn("captures.fields", total)}`;
}

/** "complete", or "3 fields lost at 12.4 s". @param {Context} context @param {Capture} capture @param {number} [most] so many entries in words */
export function ledgerIn(context, capture, most = 2) {
  const { entries, complete } = capture.ledger;
  if (complete) return context.t("captures.ledger.complete");
  if (!entries.length) return context.t("captures.ledger.empty");
  const said = entries.slice(0, most).reduce((sum, entry) => sum + entry.count, 0);
  const rest = totalOf(capture) - (capture.ledger.counts.received ?? 0) - said;
  const words = entries.slice(0, most).map((entry) => entryIn(context, entry, periodOf(capture)));
  return [...words, ...(rest ? [context.tn("captures.ledger.more", rest)] : [])].join(", ");
}

/** @param {Context} context @param {LedgerEntry} entry @param {number} field_s from field to field */
export function entryIn({ tn, format }, entry, field_s) {
  return tn(`captures.ledger.${entry.outcome}`, entry.count, { at: format.number(entry.first_n * field_s, 1) });
}

/** Reason for lost or damaged fields, in words. @param {Context} context @param {string} reason */
export function reasonIn({ t, texts }, reason) {
  const said = slug(reason);
  if (texts.has(`captures.reason.${said}`)) return t(`captures.reason.${said}`);
  const short = slug(reason.split(" (")[0]);
  return texts.has(`captures.reason.${short}`) ? t(`captures.reason.${short}`) : reason;
}

/** A change of what numbers and times go by, in words. @param {Context} context @param {LedgerEvent} event @param {number} field_s from field to field */
export function eventIn({ t, format }, event, field_s) {
  return t(`captures.rebase.${event.kind}`, { at: format.number(event.n * field_s, 1) });
}

/** Reason for the end of a capture, in words. @param {Context} context @param {string | null} because */
export function endIn({ t, texts }, because) {
  if (!because) return "–";
  return texts.has(`captures.ended.${slug(because)}`) ? t(`captures.ended.${slug(because)}`) : because;
}

/** Key of a text, from the daemon's words. @param {string} said */
const slug = (said) => said.replace(/\W+/g, "_");
