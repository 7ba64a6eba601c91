// A part of a capture as a film: the panes as they stand, field by field, none left out.
import { el, fill, setText, symbol } from "../core/dom.js";
import { numberOf } from "../core/number.js";
import { createNumberField } from "../core/number_field.js";
import { save } from "../scene/picture.js";
import { SPEEDS } from "./playhead.js";
import { createWebm } from "./webm.js";

/** @import { Context } from "../core/context.js" */

/** Half a minute at 50 fields a second: some hundred megabytes are held until the film is saved. */
const MOST_FIELDS = 1500;
const QUALITY = 0.85;
/** @type {Record<number, string>} */
const SPEED_WORDS = { 1: "1", 0.5: "½", 0.25: "¼", 0.1: "1/10" };

/**
 * @param {Context} context
 * @param {object} about
 * @param {string} about.id of the capture
 * @param {number} about.field_s from field to field
 * @param {() => number} about.total
 * @param {() => [number, number]} about.range fields that are offered: the one after the last is not among them
 * @param {(n: number) => Promise<HTMLCanvasElement | null>} about.frame draws a field whole; null if that ended
 * @param {(busy: boolean) => void} about.busy
 */
export function createFilm(context, { id, field_s, total, range, frame, busy }) {
  const { t, tn } = context;
  const limits = () => ({ least: 0, most: total() - 1, isWhole: true });
  const number = (/** @type {string} */ name) => createNumberField(context, { class: "input", inputmode: "numeric", data: { film: name }, id: `film-${name}` }, () => {}, limits);
  const [first, last] = ["first", "last"].map(number);
  const speed = el("select", { class: "input", id: "film-speed" }, SPEEDS.map((one) => el("option", { value: one }, `${SPEED_WORDS[one]} ×`)));
  const make = el("button", { class: "button primary", type: "submit", data: { do: "film" } }, symbol("download"), t("replay.film.make"));
  const stop = el("button", { class: "button", type: "button", hidden: true, on: { click: () => (stopped = true) } }, t("core.cancel"));
  const bar = el("span");
  const meter = el("div", { class: "meter", hidden: true }, bar);
  const words = el("p", { class: "small", role: "status" });
  const field = (/** @type {string} */ name, /** @type {HTMLElement[]} */ ...inputs) => el("label", { class: "field" }, el("span", { class: "field-label" }, t(`replay.film.${name}`)), inputs);
  const form = el("form", { class: "stack", on: { submit: begin } }, el("div", { class: "replay-film" }, field("first", first.input, first.problem), field("last", last.input, last.problem), field("speed", speed)), el("div", { class: "row" }, make, stop), meter, words);
  const element = el("details", { class: "card", on: { toggle: () => element.open && offer() } }, el("summary", { class: "capture-summary" }, t("replay.film.title")), el("p", { class: "muted" }, t("replay.film.about")), form);
  let stopped = false;
  let ended = false;
  let running = false;

  /** What is looped, or what lies before the playhead. */
  function offer() {
    if (running || first.input.value) return;
    const [from, end] = range();
    first.show(from);
    last.show(Math.min(end, from + MOST_FIELDS) - 1);
  }

  /** @param {Event} event */
  async function begin(event) {
    event.preventDefault();
    const [from, to] = [first, last].map(({ input }) => numberOf(input.value) ?? NaN);
    if (running) return;
    if (!(from >= 0 && to >= from && to < total())) return setText(words, t("replay.film.range", { last: total() - 1 }));
    if (to - from >= MOST_FIELDS) return setText(words, t("replay.film.tooLong", { most: MOST_FIELDS }));
    show(true);
    const film = await made(from, to).catch((problem) => void setText(words, t("replay.film.failed", { reason: problem.message })));
    show(false);
    if (!film) return;
    save(film, `${id}-${from}-${to}.webm`);
    setText(words, t("replay.film.saved", { fields: tn("captures.fields", to - from + 1), size: context.format.size(film.size) }));
  }

  /** @param {number} from @param {number} to */
  async function made(from, to) {
    /** @type {ReturnType<typeof createWebm> | null} */
    let webm = null;
    for (let n = from; n <= to; n += 1) {
      const canvas = await frame(n);
      if (!canvas || stopped || ended) return void setText(words, t("replay.film.stopped"));
      webm ??= createWebm({ width: canvas.width, height: canvas.height, frame_ms: (1000 * field_s) / Number(speed.value), title: id });
      const picture = await new Promise((/** @type {(made: Blob | null) => void} */ resolve) => canvas.toBlob(resolve, "image/webp", QUALITY));
      if (!picture) throw new Error(t("replay.film.noEncoder"));
      await webm.add(picture);
      bar.style.inlineSize = `${(100 * (n - from + 1)) / (to - from + 1)}%`;
      setText(words, t("replay.film.making", { done: n - from + 1, all: to - from + 1 }));
    }
    return webm?.film();
  }

  /** @param {boolean} on */
  function show(on) {
    running = on;
    stopped = false;
    make.disabled = on;
    stop.hidden = meter.hidden = !on;
    busy(on);
  }

  fill(words);
  return { element, end: () => (ended = true) };
}
