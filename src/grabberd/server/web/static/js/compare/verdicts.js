// Which quantities differ between the groups: their means with σ, and what the test says.
import { el, symbol } from "../core/dom.js";
import { quantityIn, valueIn } from "../liner_tests/words.js";

/** @import { Context } from "../core/context.js" */
/** @import { QuantityStudied, Study } from "types/documents" */

const MOST_GROUPS = 12;

/** What differs stands out; the rest is said. @param {Context} context @param {string} verdict */
export function verdictBadge({ t }, verdict) {
  if (!verdict) return null;
  const words = t(`compare.verdict.${verdict.replaceAll(" ", "_")}`);
  return verdict === "differ" ? el("span", { class: "badge is-warn", data: { verdict } }, symbol("compare"), words) : el("span", { class: "small muted", data: { verdict } }, words);
}

/** @param {Context} context @param {Study} study @param {(group: string) => string} nameOf a group */
export function createVerdicts(context, study, nameOf) {
  const { t, format } = context;
  const groups = study.groups.slice(0, MOST_GROUPS);
  const compared = study.quantities.filter(({ differences }) => differences.length);
  if (!compared.length) return el("section", { class: "card stack" }, el("h2", {}, t("compare.groups")), el("p", { class: "muted" }, t(study.quantities.length ? "compare.oneGroup" : "compare.nothing")));
  const sorted = [...compared.filter(({ verdict }) => verdict === "differ"), ...compared.filter(({ verdict }) => verdict !== "differ")];
  const differing = compared.filter(({ verdict }) => verdict === "differ").length;
  const untested = compared.every(({ verdict }) => verdict === "not tested");
  const two = groups.length === 2;

  /** @param {QuantityStudied} one */
  function row(one) {
    const cells = groups.map((group) => {
      const mean = one.means[one.groups.indexOf(group)];
      return el("td", { class: "number" }, mean ? valueIn(context, mean.value, mean.sigma, one.unit) : "–");
    });
    const least = Math.min(...one.differences.map(({ p }) => p ?? Infinity));
    const p = Number.isFinite(least) ? el("span", { class: "small muted number" }, least < 0.001 ? "p < 0.001" : `p = ${format.number(least, 3)}`) : null;
    const difference = two && one.differences[0] ? el("td", { class: "number" }, valueIn(context, one.differences[0].value, one.differences[0].sigma, one.unit)) : null;
    return el("tr", { data: { compared: one.name } }, el("th", { scope: "row", title: one.definition }, quantityIn(context, { ...one, value: null, sigma: null }), el("div", { class: "compare-said" }, verdictBadge(context, one.verdict), p)), cells, difference);
  }

  const heads = [t("analysis.column.quantity"), ...groups.map(nameOf), ...(two ? [t("compare.difference")] : [])];
  const table = el("table", { class: "table analysis-found compare-verdicts" }, el("thead", {}, el("tr", {}, heads.map((head, i) => el("th", { scope: "col", class: i ? "number" : "" }, head)))), el("tbody", {}, sorted.map(row)));
  const words = untested ? t("compare.untested") : context.tn("compare.differ", differing, { all: compared.length });
  return el("section", { class: "card stack" }, el("h2", {}, t("compare.groups")), el("p", { role: "status", data: { differ: differing } }, words), el("div", { class: "scroll", tabindex: 0 }, table), remarks(study));
}

/** What else is to be known, in the instrument's own words. @param {Study} study */
function remarks(study) {
  const said = [...new Set([...study.remarks, ...study.quantities.flatMap((one) => one.remarks)])];
  return said.length ? el("ul", { class: "small muted", lang: "en" }, said.map((one) => el("li", {}, one))) : null;
}
