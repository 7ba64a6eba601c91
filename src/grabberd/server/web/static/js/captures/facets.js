// What captures have in common, each value with how many have it: chosen by a touch. A column on a wide screen.
import { el, fill, symbol } from "../core/dom.js";
import { instantOf, labelNameIn, labelValueIn } from "./words.js";

/** @import { Context } from "../core/context.js" */
/** @import { Question } from "./question.js" */
/** @import { CaptureFacets } from "types/documents" */

const WIDE = "(min-width: 1100px)";
const FEW = 6;
const FIRST = ["cow", "teat", "liner"];

/** @typedef {{title: string, name: string, values: {value: string, count: number, words: string}[]}} Facet name: that of the query */

/** @param {Context} context @param {Question} question */
export function createFacets(context, question) {
  const { t, tn, format } = context;
  const body = el("div", { class: "facets-body" });
  const summary = el("summary", { class: "capture-summary" }, t("captures.facets.title"));
  const element = el("details", { class: "card facets" }, summary, body);
  const wide = matchMedia(WIDE);
  /** Facets of which all values are shown. @type {Set<string>} */
  const whole = new Set();
  /** @type {CaptureFacets | null} */
  let known = null;

  /** @param {CaptureFacets} [found] those of another answer */
  function show(found) {
    known = found ?? known;
    if (!known) return;
    const chosen = question.choices().length;
    fill(summary, t("captures.facets.title"), chosen ? el("span", { class: "badge is-busy" }, tn("captures.facets.chosen", chosen)) : null);
    const focused = document.activeElement instanceof HTMLElement ? document.activeElement.dataset.facet : undefined;
    fill(body, ...all(known).map(group), question.isNarrow() ? el("button", { class: "button wide", type: "button", on: { click: question.clear } }, symbol("close"), t("captures.all")) : null);
    // Who chooses by keyboard goes on from where they were.
    if (focused) [...body.querySelectorAll("button")].find((one) => one.dataset.facet === focused)?.focus();
  }

  /** Those that there is a choice in. @param {CaptureFacets} found @returns {Facet[]} */
  function all(found) {
    const names = [...FIRST.filter((name) => name in found.labels), ...Object.keys(found.labels).filter((name) => !FIRST.includes(name))];
    const yes = (/** @type {string} */ key) => (/** @type {string} */ value) => t(`captures.facets.${key}.${value === "1" || value === "true" ? "yes" : "no"}`);
    return [
      facet(t("captures.day"), "day", found.days, (value) => format.dayIn(noon(value))),
      ...names.map((name) => facet(labelNameIn(context, name), "label", found.labels[name].map(({ value, count }) => ({ value: `${name}=${value}`, count })), (value) => labelValueIn(context, name, value.slice(name.length + 1)))),
      facet(t("captures.facets.verdict"), "verdict", found.verdict, (value) => t(`captures.verdict.${value}`)),
      facet(t("captures.facets.analysis"), "analysed", flags(found.analysed), yes("analysed")),
      facet(t("captures.facets.kept"), "pinned", flags(found.pinned), yes("pinned")),
      facet(t("captures.facets.calibration"), "calibration", found.calibration, (value) => instantOf(value, format.when)),
      ...(found.device.length > 1 || question.get("device") ? [facet(t("captures.facets.device"), "device", found.device, (value) => value)] : []),
    ].filter(({ name, values }) => values.length > 1 || values.some(({ value }) => question.has(name, value)));
  }

  /** With what is chosen first, though no capture may have it any longer. @param {string} title @param {string} name @param {CaptureFacets["days"]} counts @param {(value: string) => string} words @returns {Facet} */
  function facet(title, name, counts, words) {
    const own = counts[0]?.value.split("=")[0];
    const lost = question.choices().filter(([of, value]) => of === name && (name !== "label" || value.split("=")[0] === own) && !counts.some((one) => one.value === value));
    const values = [...lost.map(([, value]) => ({ value, count: 0 })), ...counts];
    return { title, name, values: values.map((one) => ({ ...one, words: words(one.value) })) };
  }

  /** @param {Facet} facet */
  function group({ title, name, values }) {
    const key = `${name}:${title}`;
    const sorted = [...values.filter(({ value }) => question.has(name, value)), ...values.filter(({ value }) => !question.has(name, value))];
    const shown = whole.has(key) ? sorted : sorted.slice(0, FEW);
    const more = sorted.length > shown.length && el("button", { class: "button plain chip", type: "button", data: { facet: `${key}:more` }, on: { click: () => open(key) } }, t("captures.facets.more", { n: sorted.length - shown.length }));
    return el("fieldset", { class: "facet" }, el("legend", { class: "field-label" }, title), el("div", { class: "chips" }, shown.map((one) => chip(name, one)), more));
  }

  /** @param {string} name @param {Facet["values"][number]} value */
  function chip(name, { value, count, words }) {
    return el("button", { class: "button chip", type: "button", "aria-pressed": question.has(name, value) ? "true" : "false", data: { facet: `${name}=${value}` }, on: { click: () => question.toggle(name, value) } }, words, " ", el("span", { class: "chip-count number" }, format.number(count)));
  }

  /** @param {string} key */
  function open(key) {
    whole.add(key);
    show();
  }

  const fit = () => (element.open = wide.matches);
  fit();
  wide.addEventListener("change", fit);
  return { element, show, unmount: () => wide.removeEventListener("change", fit) };
}

/** In the middle of a day by this tablet's clock. @param {string} day "2026-03-01" */
function noon(day) {
  const [year, month, date] = day.split("-").map(Number);
  return new Date(year, month - 1, date, 12).getTime();
}

/** In the words of the query. @param {CaptureFacets["days"]} counts */
const flags = (counts) => counts.map(({ value, count }) => ({ value: value === "1" ? "true" : "false", count }));
