// Step 1: the calibration frame where both views see it, well lit.
import { el, fill, symbol } from "../core/dom.js";
import { delivers, deviceOf } from "../core/store.js";
import { createPicture } from "../live/picture.js";
import { adviceFor, isEnough } from "./advice.js";
import { chosenFrame, createFrameChoice, knownFrames } from "./calibration_frames.js";
import { poseHint } from "./poses.js";
import { addressOf, note, way } from "./steps.js";

/** @import { Context } from "../core/context.js" */
/** @import { CalibrationFrame, Device, Illumination, ViewIllumination } from "types/documents" */

const EVERY_MS = 1000;
const SOON = new Set(["opening", "ready", "capturing"]);

/** @param {Context} context */
export function createPlace(context) {
  const { t, tl, store, api, may } = context;
  const picture = createPicture(context);
  const counts = el("div", { class: "view-counts", "aria-live": "polite" });
  const words = el("div", { class: "stack", role: "status" });
  const choice = el("div");
  const pose = el("div");
  const element = el("div", { class: "calibration-two" },
    el("section", { class: "card stack" }, el("h2", {}, t("calibration.place.title")), el("ol", { class: "todo" }, tl("calibration.place.todo").map((one) => el("li", {}, one))), pose, choice, words,
      may("operator") ? el("div", { class: "row end" }, way(addressOf("take"), t("calibration.next"), "primary")) : note("idle", t("calibration.viewer"))),
    el("section", { class: "card stack" }, el("h2", {}, t("live.picture")), picture.element, counts));
  let timer = 0;
  let ended = false;
  /** @type {CalibrationFrame | null} */
  let frame = null;

  async function open() {
    const frames = await knownFrames(context);
    frame = chosenFrame(frames);
    fill(pose, poseHint(context));
    if (frames.length > 1) fill(choice, createFrameChoice(context, frames, (one) => (frame = one)).element);
    look();
  }

  async function look() {
    const device = deviceOf(store.get());
    if (!delivers(device)) showNone(device);
    else if (store.get().connection.online && document.visibilityState === "visible") await ask(device);
    if (!ended) timer = setTimeout(look, EVERY_MS);
  }

  /** @param {Device} device */
  async function ask(device) {
    const light = await api.get(`/devices/${encodeURIComponent(device.name)}/light`).catch(() => null);
    if (ended) return;
    if (light) show(light);
    else showNone(null);
  }

  /** @param {Device | null} device */
  function showNone(device) {
    fill(counts);
    say([device && SOON.has(device.state) ? note("busy", t("calibration.advice.soon")) : note("bad", t("calibration.advice.away"))]);
  }

  /** @param {Illumination} light */
  function show(light) {
    const of = frame?.targets ?? 0;
    fill(counts, ...Object.entries(light.views).map(([view, shown]) => count(view, shown, of)));
    const advice = adviceFor(light, of);
    say(advice.length ? advice.map(({ key, view }) => note("warn", el("strong", {}, t(`live.view.${view}`)), " – ", t(`calibration.advice.${key}`))) : [note("good", t("calibration.advice.good"))]);
  }

  /** Shows notes; unchanged ones are left alone, because a screen reader would read them again. @param {HTMLElement[]} notes */
  function say(notes) {
    const said = notes.map((one) => one.textContent).join();
    if (said === words.dataset.said) return;
    words.dataset.said = said;
    fill(words, ...notes);
  }

  /** @param {string} view @param {ViewIllumination} shown @param {number} of */
  function count(view, shown, of) {
    const good = isEnough(shown, of);
    return el("p", { class: `badge is-${good ? "good" : "warn"}`, data: { view } }, symbol(good ? "ok" : "warn"), t("calibration.place.count", { view: t(`live.view.${view}`), n: shown.targets, of }));
  }

  open().catch(context.refused);
  return {
    element,
    unmount() {
      ended = true;
      clearTimeout(timer);
      picture.unmount();
    },
  };
}
