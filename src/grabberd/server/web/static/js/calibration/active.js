// The active calibration, and whether camera and mirrors have moved since.
import { el, fill, symbol } from "../core/dom.js";
import { deviceOf } from "../core/store.js";
import { addressOf, note, way } from "./steps.js";
import { lackIn } from "../lights/words.js";
import { ageOf } from "./words.js";

/** @import { Context } from "../core/context.js" */
/** @import { CalibrationRow } from "types/documents" */

const LEVELS = /** @type {Record<string, string>} */ ({ fits: "good", corrected: "good", doubtful: "warn", moved: "bad", unmatched: "warn", unknown: "idle" });
const SIGNS = /** @type {Record<string, string>} */ ({ good: "ok", warn: "warn", bad: "bad", idle: "unknown" });

/** @param {Context} context @param {() => CalibrationRow[]} rows */
export function createActive(context, rows) {
  const { t, tl, store, format } = context;
  const now = el("div", { class: "stack" });
  const moved = el("div", { class: "stack", role: "status" });
  const element = el("section", { class: "card stack", "aria-labelledby": "active-title" }, el("h2", { id: "active-title" }, t("calibration.active.title")), now, el("h3", {}, t("calibration.active.moved")), moved);

  function show() {
    const device = deviceOf(store.get());
    const lack = device?.lacks.find((one) => one.lacks === "calibration");
    if (!device?.calibration) return fill(now, note("bad", el("strong", {}, t("calibration.active.none")), el("p", {}, t("calibration.active.noneText"))));
    const { id, created_utc, activated_utc } = device.calibration;
    const row = rows().find((one) => one.id === id);
    fill(now, lack ? note("bad", el("strong", {}, t("calibration.is.misfit")), el("p", {}, lackIn(context, lack))) : note("good", t("calibration.active.fits")),
      el("dl", { class: "facts" },
        el("dt", {}, t("calibration.active.made")), el("dd", {}, `${format.moment(created_utc)} · ${ageOf(context, created_utc)}`),
        el("dt", {}, t("calibration.active.since")), el("dd", {}, activated_utc ? format.moment(activated_utc) : t("calibration.active.always")),
        row?.sigma0_px ? [el("dt", {}, t("calibration.sigma0")), el("dd", {}, t("live.aid.px", { px: format.number(row.sigma0_px, 3) }))] : null,
        el("dt", {}, t("calibration.active.name")), el("dd", { class: "long" }, id)),
      el("div", { class: "row" }, way(addressOf("review", id), t("calibration.open"))));
  }

  /** @param {string} verdict */
  function showMoved(verdict) {
    const level = LEVELS[verdict] ?? "idle";
    const words = el("span", { class: `badge is-${level}`, data: { rig: verdict } }, symbol(SIGNS[level]), t(`lights.rig.words.${verdict}`));
    const why = level === "warn" || level === "bad" ? el("ul", { class: "todo" }, tl(`lights.rig.causes.${verdict}.try`).map((one) => el("li", {}, one))) : null;
    const about = verdict === "unknown" || verdict === "unmatched" ? el("p", {}, t(`calibration.active.${verdict}`)) : null;
    fill(moved, el("p", {}, words), about, why);
  }

  const ends = [
    store.subscribe((known) => deviceOf(known)?.calibration, show),
    store.subscribe((known) => deviceOf(known)?.lacks, show),
    store.subscribe((known) => deviceOf(known)?.rig?.verdict ?? "unknown", showMoved),
  ];
  return { element, show, unmount: () => ends.forEach((end) => end()) };
}
