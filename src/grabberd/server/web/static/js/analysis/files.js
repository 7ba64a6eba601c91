// An analysis taken home: its report, its tables.
import { el, symbol } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { AnalysisRow } from "types/documents" */

const TABLES = ["summary", "fields", "sections", "targets", "phases", "phase_sections", "phase_targets", "cycles", "gaps", "triangles", "edges"];

/** @param {Context} context @param {string} path of the analysis */
export function createFiles({ t, api }, path) {
  const table = (/** @type {string} */ name) => el("li", {}, el("a", { class: "button", href: api.url(`${path}/${name}.csv`), download: true, data: { table: name } }, symbol("download"), t(`analysis.table.${name}`)));
  return el("section", { class: "card" }, el("details", {}, el("summary", { class: "capture-summary" }, t("analysis.tables")), el("ul", { class: "analysis-tables" }, TABLES.map(table))));
}

/** The full report, one press away; or why there is none. @param {Context} context @param {string} path of the analysis @param {AnalysisRow} record */
export function createReportLink({ t, api }, path, record) {
  if (record.missing_extra) return el("p", { class: "note is-warn" }, symbol("warn"), t("analysis.noReport.extra", { extra: record.missing_extra }));
  if (record.page_problem) return el("p", { class: "note is-warn" }, symbol("warn"), t("analysis.noReport.problem", { problem: record.page_problem }));
  return el("a", { class: "button primary", href: api.url(`${path}/report`), target: "_blank", rel: "noopener", data: { do: "report" } }, symbol("analysis"), t("analysis.report"));
}
