// Overview: the active calibration, the check, the way to a new one, and the history.
import { el } from "../core/dom.js";
import { deviceOf } from "../core/store.js";
import { createActive } from "./active.js";
import { createCheck } from "./check.js";
import { createHistory } from "./history.js";
import { createImport } from "./import.js";
import { forgetPoses } from "./poses.js";
import { addressOf, leftAt, way } from "./steps.js";

/** @import { Context } from "../core/context.js" */
/** @import { CalibrationRow } from "types/documents" */

/** @param {Context} context */
export function createOverview(context) {
  const { t, store, api, may } = context;
  /** @type {CalibrationRow[]} */
  let rows = [];
  let ended = false;
  const active = createActive(context, () => rows);
  const check = createCheck(context);
  const history = createHistory(context, load);
  const left = leftAt();
  const anew = way(addressOf("place"), t("calibration.begin"), "primary large");
  anew.addEventListener("click", forgetPoses);
  const begin = el("div", { class: "row" }, anew, left && way(addressOf(left.step, left.id), t("calibration.goOn")));
  const element = el("div", { class: "stack" }, may("operator") ? begin : null, el("div", { class: "calibration-two" }, active.element, check.element), history.element, may("operator") ? createImport(context, load).element : null);

  async function load() {
    const device = context.device()?.name;
    const { calibrations } = await api.get("/calibrations?limit=500");
    if (ended) return;
    rows = calibrations.filter((row) => row.device === device || !row.device);
    history.show(rows);
    active.show();
  }

  const end = store.subscribe((known) => deviceOf(known)?.calibration?.id, () => load().catch(context.refused));
  return {
    element,
    unmount() {
      ended = true;
      end();
      active.unmount();
      check.unmount();
    },
  };
}
