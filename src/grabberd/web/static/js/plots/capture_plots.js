// One target of a capture over time: X, Y, Z with their σ.
import { el, fill, setText, symbol } from "../core/dom.js";
import { openCapture } from "../scene/capture_source.js";
import { INKS, createChart } from "./chart.js";
import { columnsOf, summaryOf } from "./series.js";
import { createTable } from "./table.js";
import { createTargetPicker } from "./target_picker.js";

/** @import { Context } from "../core/context.js" */
/** @import { Opened } from "../scene/capture_source.js" */
/** @import { Options } from "./chart.js" */
/** @import { Column } from "./series.js" */
/** @import { FieldPoints } from "types/documents" */

const AXES = /** @type {const} */ (["x", "y", "z"]);
const MOST_POINTS = 200_000;
const FIELD_S = 0.02;

/** @typedef {(typeof AXES)[number]} Axis */
/** @typedef {{n: number, time_s: number} & Record<`${Axis}_mm` | `sigma_${Axis}_mm`, number | null>} Place of the target; null where it was not seen */

/** @param {Context} context @param {HTMLElement} body @param {string} id @param {number} first target; NaN: the one in the middle */
export function createCapturePlots(context, body, id, first) {
  const { t, api, format } = context;
  const note = el("p", { class: "muted", role: "status" });
  const whole = el("button", { class: "button", type: "button", hidden: true, on: { click: () => load(null) } }, t("plots.whole"));
  const charts = AXES.map((axis) => ({ axis, chart: createChart(context, optionsOf(axis)) }));
  const table = createTable(context, rows, file);
  /** @type {Opened | null} */
  let opened = null;
  /** @type {Place[]} */
  let samples = [];
  let target = 0;
  let every = 1;
  let turn = 0;
  /** @type {[number, number] | null} */
  let range = null;

  /** @param {Axis} axis @returns {Options} */
  function optionsOf(axis) {
    const lines = [{ label: axis.toUpperCase(), ink: INKS[AXES.indexOf(axis)] }];
    return { title: t("plots.axis", { axis: axis.toUpperCase() }), unit: "mm", digits: 3, lines, band: true, when: (s) => `${format.number(s, 2)} s`, together: "capture", zoomed: zoom };
  }

  async function open() {
    fill(body, message("wait", "is-idle", t("shape.loading")));
    opened = await openCapture(api, id).catch(context.refused);
    if (turn < 0) return;
    if (!opened?.grid) return fill(body, message("warn", "is-warn", t("shape.noPoints")));
    const picker = createTargetPicker(context, opened.grid, first, (chosen) => {
      target = chosen;
      load(range);
    });
    target = picker.chosen();
    fill(body, el("div", { class: "plots-tools" }, picker.element, whole, table.button), note, el("div", { class: "stack" }, charts.map((one) => one.chart.element)), table.element);
    load(null);
  }

  /** Seconds of the capture; null: all of it. @param {[number, number] | null} wanted */
  async function load(wanted) {
    if (!opened) return;
    const mine = ++turn;
    const span = wanted ? `&first_n=${Math.max(0, Math.floor(wanted[0] / FIELD_S))}&end_n=${Math.ceil(wanted[1] / FIELD_S) + 1}` : "";
    const query = `run=${opened.run}&target=${target}&max_points=${MOST_POINTS}${span}`;
    const document = await api.get(`/captures/${encodeURIComponent(id)}/points?${query}`).catch(context.refused);
    if (mine !== turn || !document) return;
    range = wanted;
    every = document.every;
    samples = document.fields.map(placeOf);
    show();
  }

  function show() {
    whole.hidden = range === null;
    const gap_s = 1.5 * FIELD_S * every;
    const seen = samples.filter((sample) => sample.x_mm !== null).length;
    const parts = [t("plots.seen", { id: target, seen, all: samples.length })];
    if (every > 1) parts.push(t("plots.thinned", { every }));
    setText(note, parts.join(" "));
    for (const { axis, chart } of charts) {
      const columns = columnsOf(samples, [0, 1, -1].map((sigmas) => (one) => at(one, axis, sigmas)), gap_s);
      chart.set(columns, wordsOf(axis, columns));
    }
    table.show();
  }

  /** @param {Axis} axis @param {Column[]} columns */
  function wordsOf(axis, columns) {
    const summary = summaryOf(columns[1]);
    const name = t("plots.axis", { axis: axis.toUpperCase() });
    return summary ? t("plots.words", { name, last: format.number(summary.last, 3), least: format.number(summary.least, 3), greatest: format.number(summary.greatest, 3) }) : name;
  }

  /** A part that was drawn over is asked for again where fields were left out. @param {[number, number] | null} wanted */
  function zoom(wanted) {
    if (wanted && every > 1) load(wanted);
    else if (wanted) {
      range = wanted;
      whole.hidden = false;
    } else if (range && every === 1) {
      range = null;
      whole.hidden = true;
    }
  }

  function rows() {
    return AXES.flatMap((axis) => [
      { name: axis.toUpperCase(), unit: "mm", digits: 3, column: samples.map((one) => one[`${axis}_mm`]) },
      { name: `σ ${axis.toUpperCase()}`, unit: "mm", digits: 3, column: samples.map((one) => one[`sigma_${axis}_mm`]) },
    ]);
  }

  function file() {
    const names = AXES.flatMap((axis) => /** @type {const} */ ([`${axis}_mm`, `sigma_${axis}_mm`]));
    const columns = [samples.map((one) => one.n), samples.map((one) => one.time_s), ...names.map((name) => samples.map((one) => one[name]))];
    return { name: `${id}-target-${target}.csv`, names: ["n", "time_s", ...names], columns };
  }

  open();
  return {
    end() {
      turn = -Infinity;
      charts.forEach((one) => one.chart.end());
    },
  };
}

/** The one target's values of a field. @param {FieldPoints} field @returns {Place} */
function placeOf(field) {
  return {
    n: field.n, time_s: field.time_s, x_mm: field.x_mm[0] ?? null, y_mm: field.y_mm[0] ?? null, z_mm: field.z_mm[0] ?? null,
    sigma_x_mm: field.sigma_x_mm[0] ?? null, sigma_y_mm: field.sigma_y_mm[0] ?? null, sigma_z_mm: field.sigma_z_mm[0] ?? null,
  };
}

/** @param {Place} one @param {Axis} axis @param {number} sigmas */
function at(one, axis, sigmas) {
  const [mm, sigma_mm] = [one[`${axis}_mm`], one[`sigma_${axis}_mm`]];
  return mm === null || sigma_mm === null ? null : mm + sigmas * sigma_mm;
}

/** @param {string} name @param {string} level @param {string} text */
const message = (name, level, text) => el("div", { class: `note ${level}` }, symbol(name), el("p", {}, text));
