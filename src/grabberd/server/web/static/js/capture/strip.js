// The ledger as a strip over time: what became of every field that should have come.
import { el, fill } from "../core/dom.js";
import { entryIn, eventIn, ledgerIn, periodOf, reasonIn, totalOf } from "../captures/words.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture } from "types/documents" */

const SVG = "http://www.w3.org/2000/svg";
const LEAST = 1 / 300;
const LISTED = 12;
const OUTCOMES = ["received", "lost", "damaged", "no_signal", "overrun"];

/** @param {Context} context @param {(n: number) => void} choose */
export function createStrip(context, choose) {
  const { t, tn, format } = context;
  const picture = document.createElementNS(SVG, "svg");
  picture.setAttribute("class", "strip-picture");
  picture.setAttribute("preserveAspectRatio", "none");
  picture.setAttribute("role", "img");
  picture.addEventListener("click", (event) => {
    const box = picture.getBoundingClientRect();
    choose(Math.floor(((event.clientX - box.left) / box.width) * total));
  });
  const ends = el("div", { class: "strip-ends small muted number" });
  const legend = el("ul", { class: "strip-legend" });
  const list = el("ul", { class: "strip-list" });
  const element = el("div", { class: "strip" }, picture, ends, legend, list);
  let total = 0;

  /** @param {Capture} capture */
  function show(capture) {
    total = totalOf(capture);
    element.hidden = total === 0;
    picture.setAttribute("viewBox", `0 0 ${Math.max(1, total)} 1`);
    picture.setAttribute("aria-label", ledgerIn(context, capture, LISTED));
    picture.replaceChildren(...segments(capture), ...events(capture), ...trigger(capture));
    fill(ends, el("span", {}, "0 s"), el("span", {}, t("captures.seconds", { s: format.number(total * periodOf(capture), 1) })));
    const counts = OUTCOMES.filter((outcome) => capture.ledger.counts[outcome]);
    fill(legend, ...counts.map((outcome) => el("li", {}, el("span", { class: `strip-swatch strip-${outcome}`, "aria-hidden": "true" }), t(`capture.outcome.${outcome}`), " ", el("b", {}, tn("captures.fields", capture.ledger.counts[outcome])))));
    fill(list, ...listed(capture));
  }

  /** Whole fields as ground, the others over it, none too narrow to be seen. @param {Capture} capture */
  function segments(capture) {
    const others = capture.ledger.entries.map((entry) => rect(entry.first_n, Math.max(entry.count, total * LEAST), entry.outcome));
    return [rect(0, total, "received"), ...others, ...unlisted(capture)];
  }

  /** What lies behind the entries that are listed, if there are more. @param {Capture} capture */
  function unlisted({ ledger: { entries, entries_not_listed } }) {
    const last = entries.at(-1);
    const end = last ? last.first_n + last.count : 0;
    return entries_not_listed ? [rect(end, total - end, "unlisted")] : [];
  }

  /** Marks of changes of what numbers and times go by. @param {Capture} capture */
  function events(capture) {
    return capture.ledger.events.map((event) => rect(event.n, total * LEAST, "event"));
  }

  /** Mark of the trigger. @param {Capture} capture */
  function trigger(capture) {
    return capture.pre_trigger_fields ? [rect(capture.pre_trigger_fields, total * LEAST, "trigger")] : [];
  }

  /** @param {Capture} capture */
  function listed(capture) {
    const { entries, events: changes } = capture.ledger;
    const lost = entries.map((entry) => line(entry.first_n, `${entryIn(context, entry, periodOf(capture))}: ${reasonIn(context, entry.reason)}`));
    const lines = [...lost, ...changes.map((event) => line(event.n, eventIn(context, event, periodOf(capture))))];
    const { entries_not_listed = 0, events_not_listed = 0 } = capture.ledger;
    const rest = Math.max(lines.length - LISTED, 0) + entries_not_listed + events_not_listed;
    return rest > 0 ? [...lines.slice(0, LISTED), el("li", { class: "muted" }, tn("capture.moreEntries", rest))] : lines;
  }

  /** @param {number} n @param {string} words */
  function line(n, words) {
    return el("li", {}, el("button", { class: "button plain", type: "button", on: { click: () => choose(n) } }, el("span", {}, words)));
  }

  return { element, show };
}

/** @param {number} first @param {number} count @param {string} kind */
function rect(first, count, kind) {
  const made = document.createElementNS(SVG, "rect");
  for (const [name, value] of Object.entries({ x: first, y: 0, width: count, height: 1, class: `strip-${kind}` })) made.setAttribute(name, String(value));
  return made;
}
