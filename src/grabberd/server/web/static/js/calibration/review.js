// Steps 5 and 6: the verdict and what it rests on; accepted, or rejected with a note.
import { statusOf } from "../core/api.js";
import { el, fill, symbol } from "../core/dom.js";
import { badges, madeOf } from "./words.js";
import { activate } from "./activate.js";
import { sigma } from "./judge.js";
import { forgetPoses } from "./poses.js";
import { addressOf, forget, note, way } from "./steps.js";
import { createValidity } from "./validity.js";
import { rigTable, verdictCard } from "./verdict.js";

/** @import { Context } from "../core/context.js" */
/** @import { CalibrationReport, CalibrationRow, PerAxis } from "types/documents" */

/** @param {Context} context @param {string} id of the calibration */
export function createReview(context, id) {
  const { t, api, format, may, go } = context;
  const path = /** @type {const} */ (`/calibrations/${encodeURIComponent(id)}`);
  const element = el("div", { class: "stack" });
  let ended = false;
  /** @type {ReturnType<typeof createValidity> | null} */
  let validity = null;

  async function open() {
    const { calibrations } = await api.get("/calibrations?limit=500");
    const row = calibrations.find((one) => one.id === id);
    const report = row?.capture ? await reportOf() : null;
    if (ended) return;
    if (!row) return fill(element, note("bad", t("calibration.review.gone")), way("#calibration", t("calibration.overview")));
    validity = report?.validity ? createValidity(context, report.validity) : null;
    fill(element, report?.acceptance ? verdictCard(context, report) : note("idle", t("calibration.review.noReport")), factsOf(row, report), report?.acceptance && rigTable(context, report.acceptance), validity?.element, decide(row));
  }

  /** One that was made here has a report, as long as nobody has taken it away. */
  async function reportOf() {
    try {
      const report = await api.get(`${path}/report.json`);
      return report.result ? report : null;
    } catch (problem) {
      if (statusOf(problem) !== 404) throw problem;
      return null;
    }
  }

  /** @param {CalibrationRow} row @param {CalibrationReport | null} report */
  function factsOf(row, report) {
    return el("section", { class: "card stack" }, el("div", { class: "row between" }, el("h2", {}, row.created_utc ? format.moment(row.created_utc) : id), el("div", { class: "row" }, badges(context, row))),
      el("p", {}, madeOf(context, row)), row.note && el("p", {}, row.note),
      row.rejected && note("idle", t("calibration.review.rejected", { when: format.moment(row.rejected.rejected_utc) }), row.rejected.note && ` ${row.rejected.note}`),
      row.misfit && note("bad", row.misfit),
      report && el("dl", { class: "facts number" }, numbersOf(report).map(([name, value]) => [el("dt", {}, name), el("dd", {}, value)])),
      el("div", { class: "row" }, report && el("a", { class: "button", href: api.url(`${path}/report`), target: "_blank", rel: "noopener" }, t("calibration.review.whole")),
        el("a", { class: "button", href: api.url(path), download: `${id}.json` }, symbol("download"), t("calibration.review.file"))));
  }

  /** @param {CalibrationReport} report @returns {string[][]} */
  function numbersOf(report) {
    const { result, identification, blunders, validation } = report;
    const { typical, worst } = sigma(report);
    const mm = (/** @type {number} */ one) => format.number(one, 3);
    const axes = (/** @type {PerAxis} */ one) => `X ${mm(one.x)} · Y ${mm(one.y)} · Z ${mm(one.z)} mm`;
    const views = Object.entries(result.rms_px).map(([view, rms]) => [t("calibration.review.residual", { view: t(`live.view.${view}`) }), `x ${format.number(rms.x, 3)} · y ${format.number(rms.y, 3)} px`]);
    return [
      [t("calibration.review.sigma0"), format.number(result.sigma0, 2)],
      ...views,
      [t("calibration.review.typical"), axes(typical)],
      [t("calibration.review.worst"), axes(worst)],
      ...(validation ? [[t("calibration.review.heldOut"), axes(validation.rmse_mm)]] : []),
      [t("calibration.review.used"), t("calibration.review.usedOf", { left: identification.found.left, right: identification.found.right, of: identification.of })],
      [t("calibration.review.dropped"), format.number(blunders.length)],
    ];
  }

  /** @param {CalibrationRow} row */
  function decide(row) {
    const overview = way("#calibration", t("calibration.overview"));
    if (row.active) return el("div", { class: "stack" }, note("good", t("calibration.review.isActive")), el("div", { class: "row" }, overview));
    if (!may("operator")) return el("div", { class: "stack" }, note("idle", t("calibration.viewer")), el("div", { class: "row" }, overview));
    const accepts = row.verdict !== "failed";
    const accept = el("button", { class: `button ${accepts ? "good" : ""}`, type: "button", data: { do: "accept" }, disabled: Boolean(row.problem || row.misfit || (!accepts && !may("admin"))), on: { click: () => take(row) } }, symbol("ok"), t("calibration.review.doAccept"));
    const again = row.capture ? way(addressOf("take"), t("calibration.again"), accepts ? "" : "primary") : null;
    const reject = row.rejected ? null : el("button", { class: "button", type: "button", data: { do: "reject" }, on: { click: refuse } }, symbol("close"), t("calibration.review.doReject"));
    const ways = el("div", { class: "row between" }, el("div", { class: "row" }, overview, again), el("div", { class: "row" }, reject, accept));
    return accepts || may("admin") ? ways : el("div", { class: "stack" }, note("idle", t("calibration.verdict.adminOnly")), ways);
  }

  /** @param {CalibrationRow} row */
  async function take(row) {
    if (!(await activate(context, row))) return;
    forget();
    forgetPoses();
    go("calibration");
  }

  async function refuse() {
    const said = el("textarea", { class: "input", id: "reject-note", maxlength: 2000 });
    const body = el("div", { class: "field" }, el("label", { class: "field-label", for: "reject-note" }, t("calibration.review.why")), said);
    if (!(await context.confirm({ title: t("calibration.review.rejectTitle"), text: t("calibration.review.rejectText"), body, action: t("calibration.review.doReject") }))) return;
    try {
      await api.put(`${path}/rejection`, { body: { note: said.value.trim() } });
      forget();
      forgetPoses();
      go("calibration");
    } catch (problem) {
      context.refused(problem);
    }
  }

  open().catch(context.refused);
  return {
    element,
    unmount() {
      ended = true;
      validity?.unmount();
    },
  };
}
