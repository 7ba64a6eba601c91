// Play, pause, step, speed, loop: what moves the playhead, by touch and by keys.
import { el, setSymbol, setText, symbol } from "../core/dom.js";
import { SPEEDS } from "./playhead.js";

/** @import { Context } from "../core/context.js" */
/** @import { createPlayhead } from "./playhead.js" */

const FAR = 25;
/** Of these the arrow keys and the space bar have a meaning of their own. */
const OWN_KEYS = "input, select, textarea, canvas, [contenteditable]";
const PRESSED = "button, a, summary";
/** @type {Record<number, string>} */
const SPEED_WORDS = { 1: "1", 0.5: "½", 0.25: "¼", 0.1: "1/10" };

/**
 * @param {Context} context
 * @param {ReturnType<typeof createPlayhead>} playhead
 * @param {object} about
 * @param {number} about.field_s from field to field
 * @param {() => number} about.total
 * @param {() => Promise<[number, number] | null>} about.cycle the pulsation at the playhead
 */
export function createTransport(context, playhead, { field_s, total, cycle }) {
  const { t, format } = context;
  const sign = symbol("play");
  const word = el("span", {}, t("shape.play"));
  const play = el("button", { class: "button primary", type: "button", data: { do: "play" }, on: { click: () => playhead.play(!playhead.now().playing) } }, sign, word);
  const steps = [[-FAR, "back25"], [-1, "back"], [1, "next"], [FAR, "next25"]].map(([by, name]) => {
    const many = Math.abs(Number(by)) > 1 && Math.abs(Number(by));
    return el("button", { class: "button", type: "button", data: { step: by }, "aria-label": t(`capture.step.${name}`), title: t(`capture.step.${name}`), on: { click: () => step(Number(by)) } }, Number(by) < 0 && symbol("back"), many, Number(by) > 0 && symbol("next"));
  });
  const speeds = SPEEDS.map((speed) => el("label", {}, el("input", { type: "radio", name: "replay-speed", checked: speed === 1, on: { change: () => playhead.pace(speed) } }), SPEED_WORDS[speed]));
  const loop = el("button", { class: "button", type: "button", "aria-pressed": "false", data: { do: "loop" }, on: { click: turnLoop } }, t("replay.loop"));
  const slider = el("input", { class: "slider", type: "range", min: 0, max: Math.max(0, total() - 1), step: 1, value: 0, "aria-label": t("capture.whichField"), on: { input: () => goTo(Number(slider.value)) } });
  const when = el("output", { class: "number replay-when" });
  const state = el("p", { class: "replay-state small", role: "status" });
  const element = el("div", { class: "replay-transport" }, el("div", { class: "replay-track" }, slider, when),
    el("div", { class: "replay-buttons" }, steps.slice(0, 2), play, steps.slice(2), el("div", { class: "choices replay-speeds", role: "radiogroup", "aria-label": t("shape.speed") }, speeds), loop, state));
  let looking = false;

  /** @param {number} by */
  function step(by) {
    goTo(playhead.now().n + by);
  }

  /** @param {number} n */
  function goTo(n) {
    playhead.play(false);
    playhead.go(n);
  }

  async function turnLoop() {
    if (playhead.now().loop) return playhead.loop(null);
    if (looking) return;
    looking = true;
    loop.setAttribute("aria-pressed", "true"); // at once: where it begins is looked up first
    const found = await cycle().catch(context.refused);
    looking = false;
    if (found) playhead.loop(found);
    else context.announce(t("replay.noCycle"));
    change();
    if (found) playhead.play(true);
  }

  /** @param {KeyboardEvent} event */
  function press(event) {
    const at = /** @type {Element} */ (event.target);
    if (event.ctrlKey || event.altKey || event.metaKey || document.querySelector("dialog[open]") || at.closest(OWN_KEYS)) return;
    const far = event.shiftKey ? FAR : 1;
    /** @type {Record<string, () => void>} */
    const keys = {
      ArrowLeft: () => step(-far), ArrowRight: () => step(far), PageUp: () => step(-FAR), PageDown: () => step(FAR),
      Home: () => goTo(0), End: () => goTo(total() - 1), " ": () => playhead.play(!playhead.now().playing),
    };
    if (!keys[event.key] || (event.key === " " && at.closest(PRESSED))) return;
    event.preventDefault();
    keys[event.key]();
  }
  document.addEventListener("keydown", press);

  function change() {
    const { playing, waiting, loop: range } = playhead.now();
    setSymbol(sign, playing ? "pause" : "play");
    setText(word, t(playing ? "shape.pause" : "shape.play"));
    loop.setAttribute("aria-pressed", String(range !== null));
    const looped = range ? t("replay.looping", { first: range[0], last: range[1] - 1 }) : "";
    setText(state, waiting ? t("replay.waiting") : looped);
    element.classList.toggle("is-waiting", waiting);
  }

  return {
    element, change,
    /** @param {number} n */
    stand(n) {
      slider.max = String(Math.max(0, total() - 1));
      slider.value = String(n);
      const words = t("capture.field", { n, s: format.number(n * field_s, 2) });
      slider.setAttribute("aria-valuetext", words);
      setText(when, words);
    },
    end: () => document.removeEventListener("keydown", press),
  };
}
