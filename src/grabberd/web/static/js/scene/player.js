// Play, pause, go through, faster and slower.
import { el, setSymbol, setText, symbol } from "../core/dom.js";
import { advanced, atTheBeginning, indexAt, lengthOf, SPEEDS } from "./playback.js";

/** @import { Context } from "../core/context.js" */

/**
 * @param {Context} context
 * @param {number[]} times_s of the moments, ascending, from 0
 * @param {(index: number) => string} wordsOf a moment
 * @param {(index: number) => void} show
 */
export function createPlayer({ t, format }, times_s, wordsOf, show) {
  const length_s = lengthOf(times_s);
  let playback = atTheBeginning();
  let index = -1;
  let last_ms = 0;
  let turn = 0;

  const sign = symbol("play");
  const word = el("span", {}, t("shape.play"));
  const play = el("button", { class: "button primary", type: "button", data: { do: "play" }, disabled: length_s === 0, on: { click: () => set(!playback.playing) } }, sign, word);
  const slider = el("input", {
    class: "slider", type: "range", min: 0, max: Math.max(0, times_s.length - 1), step: 1, value: 0,
    "aria-label": t("shape.moment"), on: { input: () => goTo(Number(slider.value)) },
  });
  const when = el("span", { class: "number scene-when" });
  const speeds = SPEEDS.map((speed) => el("option", { value: speed, selected: speed === 1 }, t("shape.times", { speed: format.number(speed, speed < 1 ? (speed === 0.25 ? 2 : 1) : 0) })));
  const speed = el("select", { class: "input", "aria-label": t("shape.speed"), on: { change: () => (playback = { ...playback, speed: Number(speed.value) }) } }, speeds);
  const element = el("div", { class: "scene-player" }, play, slider, when, speed);

  /** @param {boolean} playing */
  function set(playing) {
    playback = { ...playback, playing };
    setSymbol(sign, playing ? "pause" : "play");
    setText(word, t(playing ? "shape.pause" : "shape.play"));
    cancelAnimationFrame(turn);
    last_ms = performance.now();
    if (playing) turn = requestAnimationFrame(next);
  }

  /** @param {number} now_ms */
  function next(now_ms) {
    playback = advanced(playback, Math.max(0, now_ms - last_ms) / 1000, length_s);
    last_ms = now_ms;
    tell(indexAt(times_s, times_s[0] + playback.at));
    turn = requestAnimationFrame(next);
  }

  /** @param {number} wanted */
  function goTo(wanted) {
    set(false);
    playback = { ...playback, at: times_s[wanted] - times_s[0] };
    tell(wanted);
  }

  /** @param {number} wanted */
  function tell(wanted) {
    if (wanted === index) return;
    index = wanted;
    slider.value = String(wanted);
    slider.setAttribute("aria-valuetext", wordsOf(index));
    setText(when, wordsOf(index));
    show(index);
  }

  if (times_s.length) tell(0);
  return { element, end: () => cancelAnimationFrame(turn) };
}
