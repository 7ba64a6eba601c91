// Width, or a target's place, and the vacuum, over a window of the capture that the playhead is in.
import { el, fill, setText, symbol } from "../core/dom.js";
import { INKS, createChart } from "../plots/chart.js";
import { linkOf } from "../plots/link.js";
import { movedTo } from "../plots/range.js";
import { columnsOf, summaryOf } from "../plots/series.js";
import { createTargetPicker } from "../plots/target_picker.js";
import { createCourses } from "./courses.js";
import { cycleAt, startsByCurve } from "./cycles.js";
import { windowOf } from "./vacuum.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture } from "types/documents" */
/** @import { Sample, What } from "./courses.js" */
/** @import { Measured } from "./source.js" */
/** @import { Vacuum } from "./vacuum.js" */

const SPANS_S = [2, 10, 30];
/** A capture that is no longer is looked at as a whole, at first. */
const SHORT_S = 10;
const HEIGHT = 120;
const NEAR_S = 4;
const WHATS = /** @type {const} */ (["width", "x", "y", "z"]);

/**
 * @param {Context} context
 * @param {object} about
 * @param {string} about.id of the capture
 * @param {number} about.field_s from field to field
 * @param {Measured | null} about.measured
 * @param {() => number} about.total
 * @param {(n: number) => void} about.go moves the playhead
 */
export function createCurvesPane(context, { id, field_s, measured, total, go }) {
  const { t, api, format } = context;
  const grid = measured?.grid ?? null;
  const courses = measured && grid ? createCourses(api, id, measured.run, grid) : null;
  const note = el("p", { class: "small muted", role: "status" });
  const place = el("div", { class: "replay-charts" });
  const link = linkOf("replay");
  /** @type {What} */
  const what = { what: "width", target: 0 };
  const whole = total() * field_s;
  const choices = whole > SPANS_S[2] ? SPANS_S : [...SPANS_S.filter((one) => one < whole), whole];
  let span = whole > SHORT_S ? Math.round(SHORT_S / field_s) : Math.max(1, total());
  let first = -1;
  let n = 0;
  let turn = 0;
  let filling = Promise.resolve(); // until the window is drawn
  /** @type {Vacuum | null} */
  let vacuum = null;
  /** @type {NonNullable<Capture["marks"]>} */
  let marks = [];

  const picker = grid && createTargetPicker(context, grid, NaN, (target) => watch({ target }));
  what.target = picker?.chosen() ?? 0;
  if (picker) picker.element.hidden = true;
  const kinds = el("select", { class: "input", "aria-label": t("replay.curves.what"), on: { change: () => watch({ what: WHATS.find((one) => one === kinds.value) ?? "width" }) } }, WHATS.map((one) => el("option", { value: one }, t(`replay.curves.${one}`))));
  const spans = el("select", { class: "input", "aria-label": t("replay.curves.span"), on: { change: () => setSpan(Number(spans.value)) } }, choices.map((one) => el("option", { value: one, selected: Math.abs(one - span * field_s) < field_s / 2 }, one === whole ? t("replay.curves.whole") : t("captures.seconds", { s: one }))));
  const tools = el("div", { class: "replay-tools" }, grid && kinds, spans, grid && picker?.element);
  const element = el("div", { class: "replay-body" }, tools, place, note);
  /** @type {ReturnType<typeof chartWith>[]} */
  let charts = [];

  /** @param {Partial<What>} change */
  function watch(change) {
    Object.assign(what, change);
    if (picker) picker.element.hidden = what.what === "width";
    build();
  }

  /** @param {number} seconds */
  function setSpan(seconds) {
    span = Math.round(seconds / field_s);
    first = -1;
    stand(n);
  }

  /** @param {string} title @param {string} unit @param {string[]} labels @param {boolean} band @param {[number, number]} [least] */
  function chartWith(title, unit, labels, band, least) {
    const when = (/** @type {number} */ s) => `${format.number(first * field_s + s, span * field_s > 5 ? 0 : 1)} s`;
    const lines = labels.map((label, i) => ({ label, ink: INKS[i % INKS.length], dash: i ? [7, 4] : undefined }));
    const chart = createChart(context, { title, unit, digits: 2, lines, band, when, height: HEIGHT, least, over: [0, span * field_s], together: "replay", pressed: (s) => go(Math.min(first + Math.round(s / field_s), total() - 1)) });
    return { chart, title, element: el("div", { class: "replay-chart" }, chart.element) };
  }

  function build() {
    end();
    const axis = what.what.toUpperCase();
    const moves = courses && (what.what === "width" ? chartWith(t("plots.chart.width"), "mm", [t("replay.curves.width")], false) : chartWith(t("plots.axis", { axis }), "mm", [axis], true));
    const press = vacuum && chartWith(t("live.curves.vacuum"), "kPa", vacuum.names.map(nameOf), false, [0, 45]);
    charts = [moves, press].flatMap((one) => (one ? [one] : []));
    fill(place, courses ? null : el("div", { class: "note is-warn" }, symbol("warn"), el("p", {}, t(measured ? "replay.noObject" : "replay.noPoints"))), ...charts.map((one) => one.element));
    filling = fillWindow();
  }

  /** @param {string} name */
  const nameOf = (name) => (context.texts.has(`live.curves.channel.${name}`) ? t(`live.curves.channel.${name}`) : context.texts.has(`analysis.line.${name}`) ? t(`analysis.line.${name}`) : name);

  async function fillWindow() {
    const mine = ++turn;
    place.classList.toggle("is-coming", Boolean(courses));
    const press = vacuum ? charts.at(-1) : undefined;
    if (press && vacuum) {
      const [time_s, ...kpa] = windowOf(vacuum, first * field_s, (first + span) * field_s);
      draw(press, [time_s.map((s) => Number(s) - first * field_s), ...kpa], "kPa");
    }
    placeMarks();
    if (!courses) return setText(note, vacuum ? "" : t("replay.curves.noVacuum"));
    setText(note, t("replay.curves.coming"));
    const found = await courses.of(what, first, Math.min(first + span, total())).catch((problem) => problem);
    if (mine !== turn) return;
    place.classList.remove("is-coming");
    if (!Array.isArray(found)) return setText(note, t("replay.curves.failed", { reason: String(found.detail || found.message || found) }));
    drawMoves(found);
    setText(note, [found.some((one) => one.value !== null) ? "" : t("replay.curves.unseen"), vacuum ? "" : t("replay.curves.noVacuum")].filter(Boolean).join(" "));
  }

  /** @param {Sample[]} samples */
  function drawMoves(samples) {
    const timed = samples.map((one) => ({ ...one, time_s: (one.n - first) * field_s }));
    const edge = (/** @type {number} */ sigmas) => (/** @type {Sample} */ one) => (one.value === null ? null : one.value + sigmas * one.sigma);
    const picks = what.what === "width" ? [edge(0)] : [edge(0), edge(1), edge(-1)];
    draw(charts[0], columnsOf(timed, picks, 1.5 * field_s), "mm");
  }

  /** @param {(typeof charts)[number]} one @param {(number | null)[][]} columns @param {string} unit */
  function draw({ chart, title }, columns, unit) {
    const summary = summaryOf(columns[1] ?? []);
    const number = (/** @type {number} */ value) => format.number(value, 2);
    chart.set(columns, summary ? t("plots.words", { name: `${title} ${unit}`, last: number(summary.last), least: number(summary.least), greatest: number(summary.greatest) }) : title);
    standInCharts();
  }

  function placeMarks() {
    const here = marks.filter((one) => one.n >= first && one.n < first + span).map((one) => ({ x: (one.n - first) * field_s, name: one.name }));
    for (const { chart } of charts) chart.flag(here);
  }

  function standInCharts() {
    const mark = (n - first) * field_s;
    link.set({ mark, range: movedTo(link.get().range, mark, [0, span * field_s]) });
  }

  /** @param {number} to */
  function stand(to) {
    n = to;
    const wanted = Math.floor(n / span) * span;
    if (wanted !== first) {
      first = wanted;
      build();
      const next = first + span;
      if (courses && next < total()) courses.of(what, next, Math.min(next + span, total())).catch(() => {});
    } else standInCharts();
  }

  function end() {
    for (const { chart } of charts) chart.end();
    charts = [];
  }

  return {
    element, stand,
    /** @param {NonNullable<Capture["marks"]>} now */
    mark(now) {
      marks = now;
      placeMarks();
    },
    /** @param {Vacuum | null} now */
    giveVacuum(now) {
      vacuum = now;
      if (first >= 0) build();
    },
    /** @param {number} target */
    choose(target) {
      if (!picker) return;
      picker.choose(target);
      if (what.what !== "width") watch({ target });
      else what.target = target;
    },
    /** The cycle at the playhead by the width's own course; null where nothing pulsates. */
    async cycle() {
      if (!courses) return null;
      const near = Math.round(NEAR_S / field_s);
      const found = await courses.of({ what: "width", target: 0 }, Math.max(0, n - near), Math.min(total(), n + near));
      return cycleAt(startsByCurve(found.flatMap((one) => (one.value === null ? [] : [/** @type {[number, number]} */ ([one.n, one.value])]))), n, field_s);
    },
    /** Waits until what is to be seen is drawn. */
    whole: () => filling,
    /** The drawings, with where their playhead stands, from 0 to 1. */
    pictures() {
      const [from, to] = link.get().range ?? [0, span * field_s];
      return charts.map(({ chart, title }) => ({ canvas: chart.element.querySelector("canvas"), over: chart.element.querySelector(".u-over"), title, share: ((n - first) * field_s - from) / (to - from) }));
    },
    end() {
      turn = NaN;
      end();
    },
  };
}
