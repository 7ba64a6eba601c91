// The maps of an analysis, field by field or phase by phase: those at the playhead and ahead of it, a few at a time.
import { column, hasAny } from "../analysis/tables.js";
import { QUANTITIES } from "../analysis/quantities.js";
import { scaleOver } from "../scene/scale.js";
import { pathOf, phasesOf } from "./source.js";

/** @import { Analysis, AnalysisRow } from "types/documents" */
/** @import { AnalysisMap } from "types/open_documents" */
/** @import { Scale } from "../scene/scale.js" */
/** @import { Api } from "types/routes" */

const KEPT = 200;
const AT_ONCE = 3;

/** @typedef {"field" | "phase"} Kind of this field alone, or of the mean cycle */

/**
 * @param {Api} api
 * @param {string} id
 * @param {{row: AnalysisRow, document: Analysis}} analysis
 * @param {() => void} changed told when a map has come
 */
export function createMapSource(api, id, { row, document }, changed) {
  const { tables, states } = document;
  const path = /** @type {const} */ (`${pathOf(id)}/analyses/${row.analysis}`);
  const fields = new Set(column(tables.fields, "n"));
  const steps = column(tables.phases, "phase").filter((phase) => phase !== null);
  const phases = phasesOf(document);
  /** @type {Map<string, AnalysisMap | null>} null: it cannot be had */
  const known = new Map();
  /** @type {Set<string>} */
  const asked = new Set();
  /** @type {string[]} */
  let wanted = [];
  /** @type {Map<string, Scale | null>} */
  const scales = new Map();
  let ended = false;

  // Pressures of the earlier, wrong way are left out.
  const quantities = QUANTITIES.filter(({ name }) => !(row.outdated_pressure && name.endsWith("_kpa")) && states.some((state) => hasAny(column(state.targets, name))));
  const kinds = /** @type {Kind[]} */ (["field", "phase"]).filter((kind) => (kind === "field" ? fields.size : phases && steps.length));

  /** What to ask for at a field; null where the analysis says nothing of it. @param {Kind} kind @param {number} n */
  function keyOf(kind, n) {
    if (kind === "field") return fields.has(n) ? `field=${n}` : null;
    const phase = phases?.get(n);
    if (phase === undefined) return null;
    const apart = (/** @type {number} */ one) => Math.abs(((one - phase + 1.5) % 1) - 0.5);
    return `phase=${steps.reduce((best, one) => (apart(one) < apart(best) ? one : best), steps[0])}`;
  }

  async function fetchMore() {
    const next = wanted.find((key) => !known.has(key) && !asked.has(key));
    if (ended || next === undefined || asked.size >= AT_ONCE) return;
    asked.add(next);
    fetchMore();
    const found = await api.get(`${path}/maps?${next}`).catch(() => null);
    asked.delete(next);
    known.set(next, found);
    while (known.size > KEPT) known.delete(known.keys().next().value ?? "");
    if (!ended && wanted.includes(next)) changed();
    fetchMore();
  }

  return {
    quantities, kinds, phases,
    /** The scale of a quantity over all states that the analysis has kept, so that colours can be compared. @param {string} name @returns {Scale | null} */
    scaleOf(name) {
      const quantity = QUANTITIES.find((one) => one.name === name);
      if (!quantity || !quantities.includes(quantity)) return null;
      if (!scales.has(name)) scales.set(name, scaleOver(states.flatMap((state) => column(state.targets, name)).map((value) => (value ?? NaN) * quantity.times), quantity.signed));
      return scales.get(name) ?? null;
    },
    /** A map that is here; undefined where it has still to come, null where there is none. @param {Kind} kind @param {number} n */
    at(kind, n) {
      const key = keyOf(kind, n);
      return key === null ? null : known.get(key);
    },
    /** Fetches the maps of a field and those after it. @param {Kind} kind @param {number[]} numbers */
    want(kind, numbers) {
      wanted = [...new Set(numbers.flatMap((n) => keyOf(kind, n) ?? []))];
      fetchMore();
    },
    /** Phase of a field in its cycle. @param {number} n */
    phaseOf: (n) => phases?.get(n) ?? null,
    end: () => (ended = true),
  };
}
