// Step 1: the calibration frame where both views see it, well lit.
import { el, fill, symbol } from "../core/dom.js";
import { delivers, deviceOf } from "../core/store.js";
import { createPicture } from "../live/picture.js";
import { adviceFor, isEnough } from "./advice.js";
import { chosenFrame, createFrameChoice, knownFrames, unusableNotes } from "./calibration_frames.js";
import { poseHint } from "./poses.js";
import { addressOf, note, way } from "./steps.js";

/** @import { Context } from "../core/context.js" */
/** @import { CalibrationFrame, Device, Illumination, ViewIllumination } from "types/documents" */

const SOON = new Set(["opening", "ready", "capturing"]);

/** @param {Context} context */
export function createPlace(context) {
  const { t, tl, store, may } = context;
  const picture = createPicture(context, { lit: show });
  const counts = el("div", { class: "view-counts" });
  const words = el("div", { class: "stack", role: "status" });
  const choice = el("div");
  const pose = el("div");
  const element = el("div", { class: "calibration-two" },
    el("section", { class: "card stack" }, el("h2", {}, t("calibration.place.title")), el("ol", { class: "todo" }, tl("calibration.place.todo").map((one) => el("li", {}, one))), pose, choice, words,
      may("operator") ? el("div", { class: "row end" }, way(addressOf("take"), t("calibration.next"), "primary")) : note("idle", t("calibration.viewer"))),
    el("section", { class: "card stack" }, el("h2", {}, t("live.picture")), picture.element, counts));
  /** @type {CalibrationFrame | null} */
  let frame = null;

  async function open() {
    const { frames, unusable } = await knownFrames(context);
    frame = chosenFrame(frames);
    fill(pose, poseHint(context));
    fill(choice, frames.length > 1 && createFrameChoice(context, frames, (one) => (frame = one)).element, ...unusableNotes(unusable));
  }

  /** @param {string} state of a device that gives no picture */
  function showNone(state) {
    say(counts, []);
    say(words, [SOON.has(state) ? note("busy", t("calibration.advice.soon")) : note("bad", t("calibration.advice.away"))]);
  }

  /** Of the fields that are shown, several times a second. @param {Illumination} light */
  function show(light) {
    if (!frame || silent(deviceOf(store.get())) !== null) return; // without a signal the grabber's own picture is no dark frame
    const of = frame.targets;
    say(counts, Object.entries(light.views).map(([view, shown]) => count(view, shown, of)));
    const advice = adviceFor(light, of);
    say(words, advice.length ? advice.map(({ key, view }) => note("warn", el("strong", {}, t(`live.view.${view}`)), " – ", t(`calibration.advice.${key}`))) : [note("good", t("calibration.advice.good"))]);
  }

  /** Shows what is new; the unchanged is left alone, because a screen reader would read it again. @param {HTMLElement} place @param {HTMLElement[]} said */
  function say(place, said) {
    if (said.map((one) => one.outerHTML).join("") !== place.innerHTML) fill(place, ...said);
  }

  /** @param {string} view @param {ViewIllumination} shown @param {number} of */
  function count(view, shown, of) {
    const good = isEnough(shown, of);
    return el("p", { class: `badge is-${good ? "good" : "warn"}`, data: { view } }, symbol(good ? "ok" : "warn"), t("calibration.place.count", { view: t(`live.view.${view}`), n: shown.targets, of }));
  }

  open().catch(context.refused);
  const follow = store.subscribe((known) => silent(deviceOf(known)), (state) => state !== null && showNone(state));
  return {
    element,
    unmount() {
      follow();
      picture.unmount();
    },
  };
}

/** The state of a device that gives no picture of the camera, "" if there is none; null if it gives one. @param {Device | null} device */
function silent(device) {
  const state = device?.state ?? "";
  return delivers(device) && state !== "no_signal" ? null : state;
}
