// Having the instrument measure with a calibration.

/** @import { Context } from "../core/context.js" */
/** @import { CalibrationRow } from "types/documents" */

/** Asks first, since every capture from then on is measured with it. @param {Context} context @param {CalibrationRow} row */
export async function activate(context, row) {
  const { t, api, format, confirm, announce, refused } = context;
  const made = row.created_utc ? format.moment(row.created_utc) : row.id;
  if (!(await confirm({ title: t("calibration.activate.title", { made }), text: t(textOf(row)), action: t("calibration.activate.do") }))) return false;
  try {
    await api.put("/calibrations/active", { body: { id: row.id, device: context.device()?.name, despite_failure: row.verdict === "failed" } });
    announce(t("calibration.activate.done"), { kind: "good" });
    return true;
  } catch (problem) {
    refused(problem);
    return false;
  }
}

/** @param {CalibrationRow} row */
function textOf(row) {
  if (row.verdict === "failed") return "calibration.activate.failed";
  return row.rejected ? "calibration.activate.rejected" : "calibration.activate.text";
}
