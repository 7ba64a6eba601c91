// Maps of strain, tension and pressure over the target grid, of one state at a time.
import { el, fill, setText } from "../core/dom.js";
import { createLegend } from "../scene/legend.js";
import { scaleOver } from "../scene/scale.js";
import { createMapPicture } from "./map_picture.js";
import { QUANTITIES, reasonIn, shown } from "./quantities.js";
import { column, hasAny } from "./tables.js";

/** @import { Context } from "../core/context.js" */
/** @import { Analysis } from "types/documents" */
/** @import { AnalysisMap } from "types/open_documents" */

const PAUSE_MS = 120;

/** @param {Context} context @param {`/captures/${string}/analyses/${string}`} path of the analysis @param {Analysis} document @param {number} field_s from field to field */
export function createMaps(context, path, document, field_s) {
  const { t, tn, api, format } = context;
  const { states } = document;
  const kinds = { phase: column(document.tables.phases, "phase"), field: column(document.tables.fields, "n") };
  const known = QUANTITIES.filter(({ name }) => states.some((state) => hasAny(column(state.targets, name)) || (name === "contact_kpa" && column(state.targets, "reason").some(Boolean))));
  const picture = createMapPicture(touch);
  const legend = createLegend(format.number);
  const touched = el("p", { class: "note is-idle map-touched", role: "status" });
  const without = el("ul", { class: "small" });
  const words = el("p", { class: "number", role: "status" });
  const slider = el("input", { class: "slider", type: "range", min: 0, value: 0, "aria-label": t("analysis.map.state"), on: { input: soon } });
  const body = el("tbody");
  const numbers = el("details", { class: "card", on: { toggle: () => numbers.open && showTable() } }, el("summary", { class: "capture-summary" }, t("plots.asTable")), el("div", { class: "scroll map-numbers", tabindex: 0 }, el("table", { class: "table" }, el("thead", {}, el("tr", {}, ["target", "row", "column", "value", "sigma", "why"].map((name) => el("th", { scope: "col" }, t(`analysis.map.${name}`))))), body)));
  /** @type {"phase" | "field"} */
  let kind = kinds.phase.length ? "phase" : "field";
  let quantity = known[0];
  /** @type {AnalysisMap | null} */
  let map = null;
  /** @type {number | null} */
  let chosen = null;
  let timer = 0;
  let turn = 0;

  const select = el("select", { class: "input", on: { change: () => quantify(select.value) } }, known.map(({ name }) => el("option", { value: name }, t(`analysis.quantity.${name}`))));
  const choices = el("div", { class: "choices", role: "radiogroup", "aria-label": t("analysis.map.of"), hidden: !kinds.phase.length }, /** @type {const} */ (["phase", "field"]).map((one) => el("label", {}, el("input", { type: "radio", name: "map-kind", checked: one === kind, on: { change: () => begin(one) } }), t(`analysis.map.kind.${one}`))));
  const side = el("div", { class: "stack grow" }, el("label", { class: "field" }, el("span", { class: "field-label" }, t("analysis.map.quantity")), select), choices, el("div", {}, words, slider), legend.element, touched, without);
  const missing = QUANTITIES.filter((one) => !known.includes(one));
  const lacking = missing.length ? el("p", { class: "muted" }, t("analysis.noCurve", { names: missing.map(({ name }) => t(`analysis.quantity.${name}`)).join(", ") })) : null;
  const element = el("section", { class: "card stack" }, el("h2", {}, t("analysis.maps")), known.length ? el("div", { class: "map-parts" }, el("figure", {}, picture.element, el("figcaption", { class: "small muted" }, t("analysis.map.axes"))), side) : null, lacking, known.length ? numbers : null);

  /** @param {"phase" | "field"} one */
  function begin(one) {
    kind = one;
    slider.max = String(Math.max(0, kinds[kind].length - 1));
    slider.value = String(kind === "phase" ? mostPressed() : 0);
    look();
  }

  /** The state of the mean cycle that presses most: the report's first page shows it. */
  function mostPressed() {
    const pressure = column(document.tables.phases, "mean_contact_kpa");
    return hasAny(pressure) ? pressure.indexOf(Math.max(...pressure.map((value) => value ?? -Infinity))) : 0;
  }

  /** @param {string} name */
  function quantify(name) {
    quantity = known.find((one) => one.name === name) ?? known[0];
    show();
  }

  function soon() {
    clearTimeout(timer);
    timer = setTimeout(look, PAUSE_MS);
    tell();
  }

  async function look() {
    const mine = ++turn;
    tell();
    const found = await api.get(`${path}/maps?${kind}=${kinds[kind][Number(slider.value)]}`).catch(context.refused);
    if (mine !== turn || !found) return;
    map = found;
    show();
  }

  function tell() {
    const value = kinds[kind][Number(slider.value)] ?? 0;
    setText(words, kind === "phase" ? t("shape.whenPhase", { phase: format.number(value * 100, 0) }) : t("capture.field", { n: value, s: format.number(value * field_s, 2) }));
  }

  /** One scale for all states of the capture, so that colours can be compared. @param {AnalysisMap} map */
  function scale(map) {
    const all = [...states.flatMap((state) => column(state.targets, quantity.name)), ...(map.columns[quantity.name] ?? [])];
    return scaleOver(shown(quantity, all).map((value) => value ?? NaN), quantity.signed);
  }

  function show() {
    if (!map) return;
    const values = shown(quantity, map.columns[quantity.name]);
    const found = values.filter((value) => value !== null);
    const range = scale(map);
    const name = t("shape.legend", { quantity: t(`analysis.quantity.${quantity.name}`), unit: quantity.unit });
    const least = found.length ? t("shape.range", { quantity: name, low: format.number(Math.min(...found), quantity.digits), high: format.number(Math.max(...found), quantity.digits) }) : name;
    picture.show(map.columns, values, range, least);
    legend.show(name, range);
    picture.choose(map.columns, chosen);
    showTouched(map, values);
    showReasons(map, values);
    showTable();
  }

  /** @param {number} place */
  function touch(place) {
    chosen = place;
    if (!map) return;
    picture.choose(map.columns, place);
    showTouched(map, shown(quantity, map.columns[quantity.name]));
  }

  /** @param {AnalysisMap} map @param {number} i @param {(number | null)[]} values */
  function valueIn(map, i, values) {
    const sigma = (map.columns[`sigma_${quantity.name}`]?.[i] ?? NaN) * quantity.times;
    return `${format.number(values[i], quantity.digits)} ± ${format.number(sigma, quantity.digits)} ${quantity.unit}`;
  }

  /** @param {AnalysisMap} map @param {(number | null)[]} values */
  function showTouched(map, values) {
    if (chosen === null) return setText(touched, t("analysis.map.touch"));
    const { target, row, column: across } = map.columns;
    const place = t("analysis.map.place", { target: target[chosen], row: row[chosen] + 1, column: across[chosen] + 1 });
    setText(touched, `${place}: ${values[chosen] === null ? whyNot(map, chosen) : valueIn(map, chosen, values)}`);
  }

  /** @param {AnalysisMap} map @param {number} i */
  function whyNot(map, i) {
    const reason = reasonsOf(map)[i];
    return reason ? reasonIn(context, reason) : t("analysis.map.notSeen");
  }

  /** Shows why targets have no value, the commonest reason first. @param {AnalysisMap} map @param {(number | null)[]} values */
  function showReasons(map, values) {
    /** @type {Map<string, number>} */
    const counts = new Map();
    values.forEach((value, i) => {
      if (value !== null) return;
      const reason = (reasonsOf(map)[i] ?? "").startsWith("σ of") ? t("analysis.reason.tooVague") : whyNot(map, i);
      counts.set(reason, (counts.get(reason) ?? 0) + 1);
    });
    without.hidden = !counts.size;
    fill(without, ...[...counts].sort((a, b) => b[1] - a[1]).map(([reason, count]) => el("li", {}, `${tn("analysis.map.without", count)}: ${reason}`)));
  }

  function showTable() {
    if (!numbers.open || !map) return;
    const { target, row, column: across } = map.columns;
    const now = map;
    const values = shown(quantity, map.columns[quantity.name]);
    const sigma = shown(quantity, map.columns[`sigma_${quantity.name}`] ?? []);
    fill(body, ...values.map((value, i) => el("tr", {}, [target[i], row[i] + 1, across[i] + 1, format.number(value, quantity.digits), format.number(sigma[i], quantity.digits), value === null ? whyNot(now, i) : ""].map((text) => el("td", { class: "number" }, text)))));
  }

  if (known.length) begin(kind);
  return {
    element,
    end() {
      turn = -1;
      clearTimeout(timer);
    },
  };
}

/** Reason of each missing value; empty where there is a value. @param {AnalysisMap} map @returns {string[]} */
const reasonsOf = ({ columns }) => /** @type {string[]} */ (/** @type {unknown} */ (columns.reason ?? []));
