// Two captures compared.
import { el, fill, symbol } from "../core/dom.js";
import { createCurves } from "../compare/curves.js";
import { middleOf } from "../compare/course.js";
import { createFacts } from "../compare/facts.js";
import { courseOf, openSide, phasesOf } from "../compare/side.js";
import { nameOf } from "../scene/subject_bar.js";

/** @import { PanelContext } from "./index.js" */
/** @import { Capture } from "types/documents" */

const OFFERED = 100;
const SIDES = ["id", "other"];

export const panel = {
  title: "compare.title",

  /** @param {HTMLElement} element @param {PanelContext} context */
  mount(element, context) {
    const { t, api, go, parameters } = context;
    const body = el("div", { class: "stack" });
    const selects = SIDES.map((side) => el("select", { class: "input", data: { side }, on: { change: choose } }));
    const labels = selects.map((select, i) => el("label", { class: "field grow" }, el("span", { class: "field-label" }, t(`compare.side.${SIDES[i]}`)), select));
    const back = el("a", { class: "button plain", href: "#captures" }, symbol("back"), t("captures.title"));
    element.append(el("div", {}, back, el("h1", {}, t("compare.title"))), el("div", { class: "compare-sides" }, labels), body);
    /** @type {ReturnType<typeof createCurves> | null} */
    let curves = null;
    let ended = false;

    function choose() {
      const chosen = selects.map((select) => select.value).filter(Boolean);
      if (chosen.length) go("compare", ...chosen);
    }

    async function open() {
      const { captures } = await api.get(`/captures?limit=${OFFERED}`);
      const asked = SIDES.map((side) => parameters[side] ?? "");
      const usable = captures.filter((one) => one.state === "sealed" && one.runs.length);
      selects.forEach((select, i) => list(select, usable, asked[i]));
      if (asked.every(Boolean)) return compare(asked);
      fill(body, el("p", { class: "muted" }, t(usable.length < 2 ? "compare.tooFew" : "compare.choose")));
    }

    /** @param {HTMLSelectElement} select @param {Capture[]} captures @param {string} chosen */
    function list(select, captures, chosen) {
      const missing = chosen && !captures.some((one) => one.id === chosen) ? [el("option", { value: chosen, selected: true }, chosen)] : [];
      fill(select, el("option", { value: "" }, "–"), missing, captures.map((one) => el("option", { value: one.id, selected: one.id === chosen }, nameOf(context, one))));
    }

    /** @param {string[]} ids */
    async function compare(ids) {
      fill(body, el("p", { class: "muted", role: "status" }, t("shape.loading")));
      const sides = await Promise.all(ids.map((id) => openSide(api, id)));
      const target = sides[0].grid ? middleOf(sides[0].grid) : null;
      const [courses, phases] = await Promise.all([Promise.all(sides.map((side) => courseOf(api, side, target))), Promise.all(sides.map((side) => phasesOf(api, side)))]);
      if (ended) return;
      const [grid, other] = sides.map((side) => side.grid);
      curves = grid && other ? createCurves(context, sides, grid, phases, courses) : null;
      fill(body, el("section", { class: "card" }, createFacts(context, sides, courses)), curves?.element ?? el("p", { class: "muted" }, t("shape.noPoints")));
    }

    /** @param {unknown} problem */
    function refused(problem) {
      fill(body, "");
      context.refused(problem);
    }

    open().catch(refused);
    return {
      unmount() {
        ended = true;
        curves?.end();
      },
    };
  },
};
