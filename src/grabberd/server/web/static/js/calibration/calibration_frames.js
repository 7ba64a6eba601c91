// The calibration frames that the daemon knows, and the one used on this tablet.
import { el, fill } from "../core/dom.js";
import { keep, kept } from "../core/kept.js";

/** @import { Context } from "../core/context.js" */
/** @import { CalibrationFrame } from "types/documents" */

/** @param {Context} context */
export async function knownFrames({ api }) {
  return (await api.get("/calibration-frames")).calibration_frames;
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
