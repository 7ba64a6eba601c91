// Step 2: a capture of the calibration frame, in eight bits, while nothing moves.
import { newKey, statusOf } from "../core/api.js";
import { el, fill, setText, symbol } from "../core/dom.js";
import { keep, kept } from "../core/kept.js";
import { deviceOf, rateOf } from "../core/store.js";
import { chosenFrame, createFrameChoice, knownFrames, unusableNotes } from "./calibration_frames.js";
import { addressOf, note, way } from "./steps.js";

/** @import { Context } from "../core/context.js" */
/** @import { CalibrationFrame, Capture, Device } from "types/documents" */

const SECONDS = [2, 4, 8];
const USUAL_S = 4;
const BITS = 8;
const EVERY_MS = 700;
const LENGTH = "calibration.seconds";
const PURPOSE = "calibration";

/** @param {Context} context @param {string} [id] of the capture that is being made */
export function createTake(context, id) {
  return id ? createTaking(context, id) : createRequest(context);
}

/** @param {Context} context */
function createRequest(context) {
  const { t, tl, store, api, may, go } = context;
  const choice = el("div");
  let duration_s = USUAL_S;
  const length = el("div", { class: "choices", role: "radiogroup", "aria-label": t("calibration.take.length") }, SECONDS.map((s) =>
    el("label", {}, el("input", { type: "radio", name: "seconds", value: s, checked: s === USUAL_S, on: { change: () => (duration_s = s) } }), t("calibration.take.seconds", { s }))));
  const why = el("p", { class: "field-hint", id: "take-why" });
  const start = el("button", { class: "button good large", type: "button", data: { do: "take" }, "aria-describedby": "take-why", on: { click: submit } }, symbol("start"), t("calibration.take.start"));
  const element = el("section", { class: "card stack narrow" }, el("h2", {}, t("calibration.take.title")), el("ul", { class: "todo" }, tl("calibration.take.todo").map((one) => el("li", {}, one))), choice,
    el("div", { class: "field" }, el("span", { class: "field-label" }, t("calibration.take.length")), length),
    may("operator") ? el("div", { class: "row between" }, way(addressOf("place"), t("calibration.back")), start) : note("idle", t("calibration.viewer")), why);
  const key = newKey();
  let busy = false;
  /** @type {CalibrationFrame | null} */
  let frame = null;

  async function open() {
    const { frames, unusable } = await knownFrames(context);
    frame = chosenFrame(frames);
    fill(choice, createFrameChoice(context, frames, (one) => (frame = one)).element, ...unusableNotes(unusable));
    show();
  }

  async function submit() {
    if (!frame) return;
    busy = true;
    show();
    keep(LENGTH, duration_s);
    const labels = { purpose: PURPOSE, calibration_frame: frame.name };
    try {
      const capture = await api.post("/captures", { body: { device: context.device()?.name, bits: BITS, duration_s, labels }, key });
      go("calibration", "take", capture.id);
    } catch (problem) {
      busy = false;
      context.refused(problem);
      show();
    }
  }

  function show() {
    const reason = reasonOf(deviceOf(store.get()));
    setText(why, may("operator") && reason ? t(`calibration.take.why.${reason}`) : "");
    start.disabled = busy || !frame || reason !== "";
  }

  /** @param {Device | null} device */
  function reasonOf(device) {
    if (!device || !store.get().connection.online) return "away";
    if (device.capture_id || device.armed_capture_id) return "capturing";
    if (device.sealing_capture_id) return "sealing";
    return device.state === "ready" ? "" : "notReady";
  }

  open().catch(context.refused);
  return { element, unmount: store.subscribe((known) => known, show) };
}

/** @param {Context} context @param {string} id */
function createTaking(context, id) {
  const { t, api, format } = context;
  const bar = el("span");
  const meter = el("div", { class: "meter is-busy", role: "progressbar", "aria-label": t("calibration.take.running"), "aria-valuemin": 0, "aria-valuemax": 100 }, bar);
  const words = el("p", { role: "status" });
  const element = el("section", { class: "card stack narrow" }, el("h2", {}, t("calibration.take.running")), el("p", {}, t("calibration.take.still")), meter, words);
  let timer = 0;
  let ended = false;

  async function look() {
    try {
      const capture = await api.get(`/captures/${encodeURIComponent(id)}`);
      if (!ended) show(capture);
    } catch (problem) {
      if (ended) return;
      if (statusOf(problem) === 404) fill(element, note("bad", t("calibration.take.gone")), el("div", { class: "row" }, way(addressOf("take"), t("calibration.again"), "primary")));
      else timer = setTimeout(look, 3 * EVERY_MS); // the banner says that the daemon is away
    }
  }

  /** @param {Capture} capture */
  function show(capture) {
    if (capture.state === "sealed") return location.replace(addressOf("found", id));
    const wanted = Number(kept(LENGTH) ?? USUAL_S) * rateOf(context.device());
    bar.style.inlineSize = `${Math.min(100, (100 * capture.fields) / wanted)}%`;
    setText(words, t("calibration.take.fields", { n: format.number(capture.fields) }));
    timer = setTimeout(look, EVERY_MS);
  }

  look();
  return {
    element,
    unmount() {
      ended = true;
      clearTimeout(timer);
    },
  };
}
