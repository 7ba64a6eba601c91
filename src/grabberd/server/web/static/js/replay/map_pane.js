// The map of the playhead's field: pressure, strain or tension over the target grid, of the field alone or of the mean cycle.
import { createMapPicture } from "../analysis/map_picture.js";
import { reasonIn, shown } from "../analysis/quantities.js";
import { el, fill, setText, symbol } from "../core/dom.js";
import { keep, keptText } from "../core/kept.js";
import { createLegend } from "../scene/legend.js";
import { pathOf } from "./source.js";

/** @import { Context } from "../core/context.js" */
/** @import { AnalysisMap } from "types/open_documents" */
/** @import { createMapSource, Kind } from "./map_source.js" */

const KEPT = "replay.map";

/**
 * @param {Context} context
 * @param {string} id of the capture
 * @param {ReturnType<typeof createMapSource> | null} source null without an analysis
 * @param {() => void} changed another kind of map is wanted
 */
export function createMapPane(context, id, source, changed) {
  const { t, format } = context;
  const element = el("div", { class: "replay-body" });
  const known = source?.quantities ?? [];
  if (!source || !known.length || !source.kinds.length) {
    const words = source ? t("replay.map.nothing") : t("replay.map.none");
    fill(element, el("div", { class: "note is-idle" }, symbol("info"), el("div", { class: "stack" }, el("p", {}, words), el("p", {}, el("a", { class: "button", href: `#analysis${pathOf(id).slice("/captures".length)}` }, symbol("maps"), t("capture.way.analysis"))))));
    return { element, show: () => {}, kind: () => /** @type {Kind} */ ("field"), picture: () => null };
  }
  const picture = createMapPicture((place) => {
    chosen = place;
    draw();
  });
  const legend = createLegend(format.number);
  const words = el("p", { class: "replay-of number" });
  const touched = el("p", { class: "small", role: "status" });
  let quantity = known.find((one) => one.name === keptText(KEPT)) ?? known[0];
  let kind = source.kinds[0];
  let n = 0;
  /** @type {AnalysisMap | null | undefined} */
  let map;
  /** The map that is drawn. @type {AnalysisMap | null} */
  let drawn = null;
  /** @type {number | null} */
  let chosen = null;

  const select = el("select", { class: "input", "aria-label": t("analysis.map.quantity"), on: { change: () => quantify(select.value) } }, known.map(({ name }) => el("option", { value: name, selected: name === quantity.name }, t(`analysis.quantity.${name}`))));
  const kinds = el("select", { class: "input", "aria-label": t("analysis.map.of"), on: { change: () => choose(kinds.value === "phase" ? "phase" : "field") } }, source.kinds.map((one) => el("option", { value: one }, t(`replay.map.kind.${one}`))));
  const place = el("div", { class: "replay-frame" }, picture.element);
  fill(element, el("div", { class: "replay-tools" }, select, kinds), place, legend.element, words, touched);

  /** @param {string} name */
  function quantify(name) {
    quantity = known.find((one) => one.name === name) ?? known[0];
    keep(KEPT, quantity.name);
    draw();
  }

  /** @param {Kind} one */
  function choose(one) {
    kind = one;
    changed();
  }

  function draw() {
    if (map) drawn = map;
    // A map of another field is never left under this one's number.
    place.classList.toggle("is-late", map === undefined && drawn !== null);
    picture.element.style.visibility = map === null || !drawn ? "hidden" : "";
    const about = map ? (map.phase === null ? t("replay.map.ofField", { n: map.field }) : t("shape.whenPhase", { phase: format.number(100 * map.phase, 0) })) : t(map === null ? "replay.map.notAnalysed" : "replay.map.coming", { n });
    setText(words, about);
    if (!map || !drawn) return setText(touched, "");
    const values = shown(quantity, drawn.columns[quantity.name] ?? drawn.columns.target.map(() => null));
    const scale = source?.scaleOf(quantity.name) ?? null;
    const name = legendOf();
    picture.show(drawn.columns, values, scale, `${name}. ${about}`);
    legend.show(name, scale);
    picture.choose(drawn.columns, chosen);
    setText(touched, chosen === null ? t("analysis.map.touch") : valueIn(drawn, chosen, values[chosen]));
  }

  /** Quantity and unit. */
  const legendOf = () => t("shape.legend", { quantity: t(`analysis.quantity.${quantity.name}`), unit: quantity.unit });

  /** @param {AnalysisMap} now @param {number} i @param {number | null} value */
  function valueIn(now, i, value) {
    const { target, row, column } = now.columns;
    const at = t("analysis.map.place", { target: target[i], row: row[i] + 1, column: column[i] + 1 });
    const reason = /** @type {string[]} */ (/** @type {unknown} */ (now.columns.reason ?? []))[i];
    if (value === null) return `${at}: ${reason ? reasonIn(context, reason) : t("analysis.map.notSeen")}`;
    const sigma = (now.columns[`sigma_${quantity.name}`]?.[i] ?? NaN) * quantity.times;
    return `${at}: ${format.number(value, quantity.digits)} ± ${format.number(sigma, quantity.digits)} ${quantity.unit}`;
  }

  return {
    element,
    kind: () => kind,
    /** @param {number} now @param {AnalysisMap | null | undefined} of undefined: it has still to come */
    show(now, of) {
      n = now;
      map = of;
      draw();
    },
    /** What is drawn, for a film; null where nothing is. */
    picture: () => (map ? { columns: map.columns, values: shown(quantity, map.columns[quantity.name] ?? []), scale: source.scaleOf(quantity.name), legend: legendOf(), words: words.textContent ?? "" } : null),
  };
}
