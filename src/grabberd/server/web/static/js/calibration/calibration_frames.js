// The calibration frames that the daemon knows, and the one used on this tablet.
import { el, fill } from "../core/dom.js";
import { keep, kept } from "../core/kept.js";
import { everyPage } from "../core/pages.js";
import { note } from "./steps.js";

/** @import { Context } from "../core/context.js" */
/** @import { CalibrationFrame, UnusableFrame } from "types/documents" */

/** Those that can be chosen, and files that cannot be used. @param {Context} context */
export async function knownFrames({ api }) {
  const pages = await everyPage((query) => api.get(`/calibration-frames?${query}`));
  return { frames: pages.flatMap((page) => page.calibration_frames), unusable: pages.flatMap((page) => page.unusable) };
}

/** What is wrong with files that cannot be used, in the instrument's own words. @param {UnusableFrame[]} unusable */
export function unusableNotes(unusable) {
  return unusable.map(({ problem, hint }) => note("warn", el("p", { lang: "en" }, problem), el("p", { class: "small", lang: "en" }, hint)));
}

/** The one that was chosen on this tablet, or the first. @param {CalibrationFrame[]} frames */
export function chosenFrame(frames) {
  return frames.find((one) => one.name === kept("calibration.frame")) ?? frames[0] ?? null;
}

/** @param {Context} context @param {CalibrationFrame[]} frames @param {(frame: CalibrationFrame | null) => void} chosen */
export function createFrameChoice({ t, format }, frames, chosen) {
  const choice = el("select", { class: "input", id: "calibration-frame", on: { change: take } });
  const about = el("p", { class: "field-hint" });
  fill(choice, ...frames.map((one) => el("option", { value: one.name }, one.name)));
  choice.value = chosenFrame(frames)?.name ?? "";

  function take() {
    keep("calibration.frame", choice.value);
    show();
    chosen(chosenFrame(frames));
  }

  function show() {
    const frame = chosenFrame(frames);
    const [long, short] = frame?.size_mm ?? [];
    const values = { n: frame?.targets, long: format.number(long), short: format.number(short), diameter: format.number(frame?.target_diameter_mm, 1) };
    fill(about, frame ? t("calibration.frame.about", values) : t("calibration.frame.none"));
  }

  show();
  return { element: el("div", { class: "field" }, el("label", { class: "field-label", for: "calibration-frame" }, t("calibration.frame.title")), choice, about) };
}
