// Analyses of earlier versions with wrong pressures, or with a wrong name for one: marked in lists, and at the top of what they found.
import { el, symbol } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { AnalysisRow } from "types/documents" */

/** Which texts say what is wrong; null where nothing is. @param {AnalysisRow} record */
const wrongIn = (record) => (record.outdated_pressure ? "outdated" : record.outdated_overpressure ? "renamed" : null);

/** For a line of a list; null where there is nothing wrong. @param {Context} context @param {AnalysisRow} record */
export function outdatedMark({ t }, record) {
  const wrong = wrongIn(record);
  return wrong && el("span", { class: "small", data: { [wrong]: "" } }, symbol("warn"), t(`analysis.${wrong}.mark`));
}

/** What is wrong and what to do; null where there is nothing wrong. @param {Context} context @param {AnalysisRow} record */
export function outdatedNote({ t }, record) {
  const wrong = wrongIn(record);
  return wrong && el("div", { class: `note is-${wrong === "outdated" ? "bad" : "warn"}`, data: { [wrong]: "" } }, symbol(wrong === "outdated" ? "bad" : "warn"), el("div", {}, el("strong", {}, t(`analysis.${wrong}.title`)), el("p", {}, t(`analysis.${wrong}.about`))));
}
