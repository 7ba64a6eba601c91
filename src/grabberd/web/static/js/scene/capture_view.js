// A capture played: its measured points part by part, or the mean cycle of one of its analyses.
import { el, fill, symbol } from "../core/dom.js";
import { measuredPart, meanCycle, openCapture } from "./capture_source.js";
import { createPlayer } from "./player.js";
import { createViewer } from "./viewer.js";

/** @import { Context } from "../core/context.js" */
/** @import { Drawable, Played } from "./capture_source.js" */
/** @import { Moment } from "./moments.js" */

/** @typedef {{part: number, analysis: number}} Choice analysis 0: the measured points */

/** @param {Context} context @param {HTMLElement} body @param {string} id */
export function createCaptureView(context, body, id) {
  const { t, tn, api, format } = context;
  const place = el("div");
  const choices = el("div", { class: "scene-choices" });
  const playerPlace = el("div", { class: "grow" });
  /** @type {(() => void)[]} */
  let ends = [];
  let turn = 0;

  async function open() {
    fill(body, note("wait", "is-idle", t("shape.loading")));
    const opened = await openCapture(api, id).catch(context.refused);
    if (turn < 0) return;
    if (!opened?.grid) fill(body, note("warn", "is-warn", t("shape.noPoints")));
    else begin({ ...opened, grid: opened.grid });
  }

  /** @param {Drawable} opened */
  function begin(opened) {
    const state = { part: 0, analysis: 0 };
    const change = (/** @type {Partial<Choice>} */ to) => load(opened, Object.assign(state, to));
    fill(choices, whatOf(opened, change), partOf(opened, change));
    fill(body, el("div", { class: "scene-top" }, choices, playerPlace), place);
    change({});
  }

  /** @param {Drawable} opened @param {Choice} state */
  async function load(opened, state) {
    const mine = ++turn;
    const asked = state.analysis ? meanCycle(api, opened, state.analysis) : measuredPart(api, opened, state.part);
    const found = await asked.catch(context.refused);
    if (mine !== turn || !found) return;
    stop();
    if (found.moments.length) show(opened, found);
    else fill(place, note("warn", "is-warn", t("shape.noPoints")));
  }

  /** @param {Drawable} opened @param {Played} found */
  function show(opened, found) {
    const viewer = createViewer(context, { grid: opened.grid, frusta: opened.frusta, quantities: found.quantities, moments: found.moments, when, file: id, addressOf });
    const player = createPlayer(context, found.times_s, (index) => when(found.moments[index]), (index) => viewer.show(found.moments[index]));
    fill(playerPlace, player.element);
    fill(place, viewer.element);
    ends = [viewer.end, player.end];
  }

  const addressOf = (/** @type {number} */ target) => `#plots/${encodeURIComponent(id)}/${target}`;

  /** @param {Moment} moment */
  const when = (moment) =>
    moment.phase === null
      ? t("shape.whenField", { n: moment.n ?? 0, seconds: format.number(moment.time_s, 2) })
      : t("shape.whenPhase", { phase: format.number(100 * moment.phase) });

  /** @param {Drawable} opened @param {(to: Partial<Choice>) => void} change */
  function whatOf(opened, change) {
    if (!opened.analyses.length) return null;
    const analyses = opened.analyses.map((one) => el("option", { value: one.analysis }, t("shape.analysis", { n: one.analysis })));
    const select = el("select", { class: "input", id: "scene-what", on: { change: () => change({ analysis: Number(select.value) }) } }, el("option", { value: 0 }, t("shape.measured")), analyses);
    return el("div", { class: "field" }, el("label", { class: "visually-hidden", for: "scene-what" }, t("shape.what")), select);
  }

  /** @param {Drawable} opened @param {(to: Partial<Choice>) => void} change */
  function partOf(opened, change) {
    if (opened.parts < 2) return null;
    const choose = () => change({ part: Number(slider.value) - 1, analysis: 0 });
    const slider = el("input", { class: "slider", id: "scene-part", type: "range", min: 1, max: opened.parts, step: 1, value: 1, on: { change: choose } });
    return el("div", { class: "field grow" }, el("label", { class: "field-label", for: "scene-part" }, tn("shape.parts", opened.parts)), slider);
  }

  function stop() {
    ends.forEach((end) => end());
    ends = [];
  }

  open();
  return {
    end() {
      turn = -Infinity;
      stop();
    },
  };
}

/** @param {string} name @param {string} level @param {string} text */
const note = (name, level, text) => el("div", { class: `note ${level}` }, symbol(name), el("p", {}, text));
