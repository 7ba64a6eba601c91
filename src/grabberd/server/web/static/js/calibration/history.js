// Every calibration there is, the newest first: to look at, and to go back to.
import { el, fill } from "../core/dom.js";
import { activate } from "./activate.js";
import { addressOf, way } from "./steps.js";
import { ageOf, badges, madeOf } from "./words.js";

/** @import { Context } from "../core/context.js" */
/** @import { CalibrationRow } from "types/documents" */

/** @param {Context} context @param {() => void} changed */
export function createHistory(context, changed) {
  const { t, format, may } = context;
  const list = el("ul", { class: "calibrations" });
  const element = el("section", { class: "card stack", "aria-labelledby": "history-title" }, el("h2", { id: "history-title" }, t("calibration.history.title")), list);

  /** @param {CalibrationRow} row */
  function item(row) {
    const when = row.created_utc ? `${format.moment(row.created_utc)} · ${ageOf(context, row.created_utc)}` : row.id;
    return el("li", { class: "calibration-row", data: { calibration: row.id } },
      el("div", { class: "stack tight grow" }, el("div", { class: "row" }, el("strong", {}, when), badges(context, row)),
        el("p", { class: "small" }, madeOf(context, row), row.sigma0_px ? ` · ${t("calibration.sigma0")} ${t("live.aid.px", { px: format.number(row.sigma0_px, 3) })}` : ""),
        row.note && el("p", { class: "small" }, row.note), row.rejected?.note && el("p", { class: "small muted" }, t("calibration.history.rejectedWith", { note: row.rejected.note }))),
      el("div", { class: "row" }, row.problem ? null : way(addressOf("review", row.id), t("calibration.open")), canActivate(row) ? activation(row) : null));
  }

  /** @param {CalibrationRow} row */
  function canActivate(row) {
    return may("operator") && !row.active && !row.problem && !row.misfit;
  }

  /** @param {CalibrationRow} row */
  function activation(row) {
    return el("button", { class: "button", type: "button", data: { do: "activate" }, on: { click: async () => (await activate(context, row)) && changed() } }, t("calibration.activate.do"));
  }

  return {
    element,
    /** @param {CalibrationRow[]} rows */
    show(rows) {
      fill(list, ...(rows.length ? rows.map(item) : [el("li", { class: "muted" }, t("calibration.history.none"))]));
    },
  };
}
