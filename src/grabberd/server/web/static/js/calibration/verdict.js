// The verdict on a calibration with its reasons, and the rig as built, as it was and as found.
import { el, symbol } from "../core/dom.js";
import { inFavour, LEVELS } from "./judge.js";

/** @import { Context } from "../core/context.js" */
/** @import { InFavour } from "./judge.js" */
/** @import { AcceptanceReason, CalibrationAcceptance, CalibrationReport, RigComparison } from "types/documents" */

const SYMBOLS = { good: "ok", warn: "warn", bad: "close" };
const HEADS = ["quantity", "nominal", "previous", "found", "fromNominal", "fromPrevious"];
/** Digits after the point, by name; others are whole numbers or text. @type {Record<string, number>} */
const DIGITS = { mm: 3, px: 2, percent: 2, sigma0: 2, times: 1, z: 1, correlation: 2, found: 2, other: 2 };

/** @param {Context} context @param {CalibrationReport} report */
export function verdictCard(context, report) {
  const { t } = context;
  const { verdict, reasons } = report.acceptance;
  const level = LEVELS[verdict];
  const said = reasons.length ? reasons.map((one) => reasonItem(context, one)) : inFavour(report).map((one) => el("li", {}, favour(context, one)));
  return el("section", { class: `verdict is-${level}`, data: { verdict } }, symbol(SYMBOLS[level]),
    el("div", { class: "stack grow" }, el("h2", {}, t(`calibration.verdict.${verdict}`)), el("ul", { class: "stack" }, said)));
}

/** @param {Context} context @param {AcceptanceReason} one */
function reasonItem(context, one) {
  const { t } = context;
  const values = shown(context, one.values);
  return el("li", { data: { reason: one.code } },
    one.level === "failed" && el("strong", {}, t("calibration.verdict.fails"), " "),
    t(`calibration.acceptance.${one.code}.what`, values), el("br"), el("span", { class: "small" }, t(`calibration.acceptance.${one.code}.do`, values)));
}

/** Numbers and names as people read them. @param {Context} context @param {AcceptanceReason["values"]} values @returns {Record<string, string>} */
function shown({ t, format }, values) {
  const words = Object.entries(values).map(([name, value]) => {
    if (name === "view") return [name, value ? t(`live.view.${value}`) : t("calibration.rig.whole")];
    if (name === "quantity") return [name, t(`calibration.rig.${value}`)];
    return [name, typeof value === "number" ? format.number(value, DIGITS[name] ?? 0) : value];
  });
  return Object.fromEntries(words);
}

/** @param {Context} context @param {InFavour} one */
function favour({ t, format }, { key, values: { mm, ...others } }) {
  return t(`calibration.reasons.${key}`, mm === undefined ? others : { ...others, mm: format.number(mm, 3) });
}

/** @param {Context} context @param {CalibrationAcceptance} acceptance */
export function rigTable(context, acceptance) {
  const { t } = context;
  const heads = HEADS.map((one, i) => el("th", { scope: "col", class: i ? "number" : "" }, t(`calibration.rig.head.${one}`)));
  return el("section", { class: "card stack" }, el("h2", {}, t("calibration.rig.title")),
    el("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": t("calibration.rig.title") }, el("table", { class: "table" }, el("thead", {}, el("tr", {}, heads)), el("tbody", {}, acceptance.rig.map((one) => rigRow(context, one))))),
    el("p", { class: "muted small" }, t("calibration.rig.about")));
}

/** @param {Context} context @param {RigComparison} one */
function rigRow({ t, format }, one) {
  const digits = one.quantity === "handedness" ? 0 : 2;
  const unit = one.unit === "deg" ? "°" : one.unit;
  const name = [t(`calibration.rig.${one.quantity}`), one.view && t(`live.view.${one.view}`)].filter(Boolean).join(", ");
  const value = (/** @type {number | null} */ number) => el("td", { class: "number" }, number === null ? "–" : `${format.number(number, digits)} ${unit}`);
  const sigmas = (/** @type {number | null} */ z) => el("td", { class: "number" }, z === null ? "–" : `${format.number(z, 1)} σ`);
  return el("tr", {}, el("th", { scope: "row" }, name), value(one.nominal), value(one.previous), value(one.found), sigmas(one.nominal_z), sigmas(one.previous_z));
}
