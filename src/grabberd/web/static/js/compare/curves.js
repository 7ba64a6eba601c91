// The movements of two captures, laid over each other by time or by phase.
import { FIELD_S } from "../captures/words.js";
import { el, fill, setText } from "../core/dom.js";
import { INKS, createChart } from "../plots/chart.js";
import { createTargetPicker } from "../plots/target_picker.js";
import { middleOf, overPhase, overTime } from "./course.js";
import { courseOf } from "./side.js";

/** @import { Context } from "../core/context.js" */
/** @import { Grid } from "../scene/grid.js" */
/** @import { Course } from "./course.js" */
/** @import { Side } from "./side.js" */

const DASH = [7, 4];

/**
 * @param {Context} context
 * @param {Side[]} sides
 * @param {Grid} grid of the first
 * @param {(Map<number, number> | null)[]} phases
 * @param {Course[]} first of a target in the middle
 */
export function createCurves(context, sides, grid, phases, first) {
  const { t, format } = context;
  const cyclic = phases.every(Boolean);
  const place = el("div");
  const note = el("p", { class: "muted", role: "status" }, cyclic ? "" : t("compare.noPhase"));
  const picker = createTargetPicker(context, grid, middleOf(grid), () => look());
  const what = choices("compare-what", ["target", "width"], "target", () => look());
  const over = choices("compare-over", ["time", "phase"], cyclic ? "phase" : "time", () => show());
  over.element.hidden = !cyclic;
  const element = el("section", { class: "card stack" }, el("h2", {}, t("compare.curves")), el("div", { class: "compare-tools" }, what.element, over.element, picker.element), place, note);
  /** @type {ReturnType<typeof createChart> | null} */
  let chart = null;
  let courses = first;
  let turn = 0;

  /** @param {string} name @param {string[]} kinds @param {string} first @param {() => void} changed */
  function choices(name, kinds, first, changed) {
    const inputs = kinds.map((kind) => el("input", { type: "radio", name, value: kind, checked: kind === first, on: { change: changed } }));
    const labels = inputs.map((input) => el("label", {}, input, t(`compare.choice.${input.value}`)));
    const made = el("div", { class: "choices", role: "radiogroup", "aria-label": t(`compare.${name === "compare-what" ? "what" : "over"}`) }, labels);
    return { element: made, chosen: () => inputs.find((one) => one.checked)?.value };
  }

  async function look() {
    const mine = ++turn;
    const target = what.chosen() === "width" ? null : picker.chosen();
    picker.element.hidden = target === null;
    const found = await Promise.all(sides.map((side) => courseOf(context.api, side, target))).catch(context.refused);
    if (mine !== turn || !found) return;
    courses = found;
    show();
  }

  function show() {
    chart?.end();
    const byPhase = over.chosen() === "phase";
    const title = what.chosen() === "width" ? t("compare.width") : t("compare.depth", { id: picker.chosen() });
    const when = (/** @type {number} */ x) => (byPhase ? `${format.number(x * 100, 0)} %` : `${format.number(x, 1)} s`);
    const lines = sides.map(({ capture }, i) => ({ label: format.time(capture.created_utc), ink: INKS[i], dash: i ? DASH : undefined }));
    chart = createChart(context, { title, unit: "mm", digits: 2, when, lines });
    fill(place, chart.element);
    chart.set(byPhase ? overPhase(courses, /** @type {Map<number, number>[]} */ (phases)) : overTime(courses, FIELD_S), title);
    setText(note, [cyclic ? "" : t("compare.noPhase"), courses.some((course) => !course.size) ? t("compare.notSeen") : ""].join(" ").trim());
  }

  show();
  return {
    element,
    end() {
      turn = -1;
      chart?.end();
    },
  };
}
