// A calibration in words: where it is from, how old, whether it is in force and fits.
import { el, symbol } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { CalibrationRow } from "types/documents" */

/** @param {Context} context @param {CalibrationRow} row */
export function badges({ t }, row) {
  const badge = (/** @type {string} */ level, /** @type {string} */ sign, /** @type {string} */ key) => el("span", { class: `badge is-${level}` }, symbol(sign), t(`calibration.is.${key}`));
  return [
    row.active && badge("good", "ok", "active"),
    row.rejected && badge("idle", "close", "rejected"),
    row.problem ? badge("bad", "bad", "damaged") : row.misfit ? badge("bad", "bad", "misfit") : badge("idle", "ok", "fits"),
  ];
}

/** Origin of a calibration. @param {Context} context @param {CalibrationRow} row */
export function madeOf({ t }, row) {
  if (row.capture) return [t("calibration.made.capture"), " ", el("a", { href: `#captures/${encodeURIComponent(row.capture)}` }, row.capture)];
  return row.origin ? [t(`calibration.made.${row.origin}`), row.source ? ` · ${row.source}` : ""] : [row.problem];
}

/** @param {Context} context @param {string} utc */
export function ageOf({ tn, now_ms }, utc) {
  return tn("lights.calibration.age", Math.max(0, Math.floor((now_ms() - Date.parse(utc)) / 86_400_000)));
}
