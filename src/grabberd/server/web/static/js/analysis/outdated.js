// Analyses whose pressures were found in the earlier, wrong way: marked in lists, and at the top of what they found.
import { el, symbol } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { AnalysisRow } from "types/documents" */

/** For a line of a list; null where there is nothing wrong. @param {Context} context @param {AnalysisRow} record */
export const outdatedMark = ({ t }, record) => (record.outdated_pressure ? el("span", { class: "small", data: { outdated: "" } }, symbol("warn"), t("analysis.outdated.mark")) : null);

/** What is wrong and what to do; null where there is nothing wrong. @param {Context} context @param {AnalysisRow} record */
export const outdatedNote = ({ t }, record) => (record.outdated_pressure ? el("div", { class: "note is-bad", data: { outdated: "" } }, symbol("bad"), el("div", {}, el("strong", {}, t("analysis.outdated.title")), el("p", {}, t("analysis.outdated.about")))) : null);
