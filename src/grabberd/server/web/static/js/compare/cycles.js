// The mean cycles of the captures laid over each other, as their analyses have them.
import { lineOf } from "../captures/words.js";
import { el, fill, setText } from "../core/dom.js";
import { INKS, createChart } from "../plots/chart.js";
import { tableOf, together } from "./csv_table.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture } from "types/documents" */
/** @import { Column } from "./csv_table.js" */

/** @typedef {{capture: Capture, analysis: string}} Analysed */
/** @typedef {{x: Column, values: Column, sigma: Column}} Line */

const DASHES = [undefined, [8, 4], [2, 3]];
const MOST = INKS.length * DASHES.length;
/** From which table of the analysis each comes. @type {Record<string, {table: string, unit: string, digits: number, pick: (table: Map<string, Column>) => Line}>} */
const CURVES = {
  distance: { table: "phase_sections", unit: "mm", digits: 2, pick: middleOf },
  contact: { table: "phases", unit: "kPa", digits: 2, pick: (table) => columnOf(table, "mean_contact_kpa") },
  vacuum: { table: "phases", unit: "kPa", digits: 1, pick: (table) => columnOf(table, "pulsation_vacuum_kpa") },
};

/** @param {Context} context @param {Analysed[]} all those that are analysed */
export function createCycles(context, all) {
  const { t, api, format } = context;
  const shown = all.slice(0, MOST);
  const place = el("div");
  const note = el("p", { class: "muted", role: "status" });
  const radios = Object.keys(CURVES).map((name, i) => el("input", { type: "radio", name: "compare-curve", value: name, checked: i === 0, on: { change: () => look(name) } }));
  const choices = el("div", { class: "choices", role: "radiogroup", "aria-label": t("compare.curve.title") }, radios.map((one) => el("label", {}, one, t(`compare.curve.${one.value}`))));
  const element = el("section", { class: "card stack" }, el("h2", {}, t("compare.cycles")), choices, place, note);
  /** @type {Map<string, Promise<string | null>>} */
  const texts = new Map();
  /** @type {ReturnType<typeof createChart> | null} */
  let chart = null;
  let turn = 0;

  /** The text of a table, fetched once. @param {Analysed} one @param {string} table */
  function textOf({ capture, analysis }, table) {
    const path = api.url(`/captures/${encodeURIComponent(capture.id)}/analyses/${analysis}/${table}.csv`);
    const known = texts.get(path) ?? fetch(path).then((answer) => (answer.ok ? answer.text() : null)).catch(() => null);
    texts.set(path, known);
    return known;
  }

  /** @param {string} name */
  async function look(name) {
    const mine = ++turn;
    const { table, unit, digits, pick } = CURVES[name];
    setText(note, t("compare.loading"));
    const found = await Promise.all(shown.map(async (one) => ({ one, text: await textOf(one, table) })));
    if (mine !== turn) return;
    const lines = found.flatMap(({ one, text }, i) => {
      const line = text ? pick(tableOf(text)) : null;
      return line?.values.some((value) => value !== null) ? [{ ...line, label: lineOf(context, one.capture), ink: INKS[i % INKS.length], dash: DASHES[Math.floor(i / INKS.length)], column: `${name}_${one.capture.id}` }] : [];
    });
    chart?.end();
    chart = null;
    const title = t(`compare.curve.${name}`);
    if (lines.length) {
      chart = createChart(context, { title, unit, digits, lines, joined: true, height: 300, when: (x) => `${format.number(x * 100, 0)} %`, x: { name: "phase", label: t("analysis.axis.phase") }, file: `compare-${name}` });
      const { columns, sigmas } = together(lines);
      chart.set(columns, title, sigmas);
    }
    fill(place, chart?.element);
    const without = shown.length - lines.length;
    setText(note, [without ? context.tn("compare.without", without) : "", all.length > MOST ? t("compare.most", { n: MOST }) : ""].filter(Boolean).join(" "));
  }

  look(Object.keys(CURVES)[0]);
  return {
    element,
    end() {
      turn = -1;
      chart?.end();
    },
  };
}

/** @param {Map<string, Column>} table @param {string} name @returns {Line} */
const columnOf = (table, name) => ({ x: table.get("phase") ?? [], values: table.get(name) ?? [], sigma: table.get(`sigma_${name}`) ?? [] });

/** How far apart opposite walls are at the middle height, or the wall and the plane. @param {Map<string, Column>} table @returns {Line} */
function middleOf(table) {
  const heights = table.get("height_mm") ?? [];
  const known = [...new Set(heights)].sort((a, b) => (a ?? 0) - (b ?? 0));
  const rows = heights.flatMap((height, i) => (height === known[Math.floor(known.length / 2)] ? [i] : []));
  const name = (table.get("opposite_mm") ?? []).some((value) => value !== null) ? "opposite_mm" : "distance_mm";
  const pick = (/** @type {Column} */ column) => rows.map((i) => column[i] ?? null);
  const { x, values, sigma } = columnOf(table, name);
  return { x: pick(x), values: pick(values), sigma: pick(sigma) };
}
