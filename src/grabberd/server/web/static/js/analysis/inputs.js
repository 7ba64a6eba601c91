// From the filled-in form to the inputs of an analysis, and back. Nothing here touches the page.
import { numberOf } from "../core/number.js";
import { GROUPS, NAMES } from "./fields.js";

/** @import { Part } from "./fields.js" */
/** @import { AnalysisInputs, VacuumSource } from "types/open_documents" */

/** @typedef {Record<string, string>} Values what was filled in, by part and name: "material" → "linear", "material.E_mpa" → "3" */
const LIGHT = "light";
/** A vacuum that was recorded, and has no numbers here. */
const RECORDED = ["log", "channel"];
const HEIGHTS = [".height1", ".height2", ".height3"];

/** @param {Part} part @param {string} name */
export const keyOf = (part, name) => `${part.path}.${name}`;

/** The numbers that are asked for with what was chosen. @param {Part} part @param {Values} values */
export const askedOf = (part, values) => part.numbers[part.kinds ? values[part.path] || "-" : ""] ?? [];

/** The inputs that were given. @param {Values} values */
export function inputsOf(values) {
  const vacuum = vacuumOf(values);
  const heights = HEIGHTS.filter((key) => given(values, key)).map((key) => one(values, key));
  return known({
    reference: referenceOf(values),
    material: values.material ? { law: values.material, ...numbers("material", values) } : undefined,
    vacuum: Object.keys(vacuum).length ? vacuum : undefined,
    sought_kpa: one(values, ".sought_kpa"),
    plane: planeOf(values),
    heights_mm: heights.length ? heights : undefined,
    phases: one(values, ".phases"),
  });
}

/** @param {Values} values */
function referenceOf(values) {
  const kind = values.reference;
  if (!kind) return undefined;
  return kind === "nominal" ? kind : { [kind]: one(values, `reference.${kind}`) };
}

/** @param {Values} values */
function vacuumOf(values) {
  const source = (/** @type {string} */ path) => (!values[path] ? undefined : RECORDED.includes(values[path]) ? values[path] : numbers(path, values));
  return known({ pulsation: source("vacuum.pulsation"), liner: source("vacuum.liner"), ...clockOf(values) });
}

/** What relates the clocks of camera and vacuum. @param {Values} values */
function clockOf(values) {
  const clock = values["vacuum.clock"];
  if (!clock) return {};
  return clock === LIGHT ? { offset: LIGHT } : { [clock]: numbers("vacuum.clock", values) };
}

/** @param {Values} values */
function planeOf(values) {
  if (values.plane !== "own") return values.plane || undefined;
  const { x, y, z, nx, ny, nz } = numbers("plane", values);
  return { point_mm: [x, y, z], normal: [nx, ny, nz] };
}

/** The numbers of the part with this path that were given. @param {string} path @param {Values} values */
function numbers(path, values) {
  const part = parts().find((each) => each.path === path);
  const asked = part ? askedOf(part, values) : [];
  return Object.fromEntries(asked.filter(({ name }) => given(values, `${path}.${name}`)).map(({ name }) => [name, one(values, `${path}.${name}`)]));
}

/** Inputs still missing: a part is either complete or empty, and what was typed is a number. @param {Values} values @param {string} log @returns {string[]} keys */
export function missingOf(values, log) {
  const holes = parts().flatMap((part) => askedOf(part, values).map((asked) => ({ key: keyOf(part, asked.name), needed: part.kinds && !asked.free })).filter(({ key, needed }) => (given(values, key) ? Number.isNaN(numberOf(values[key])) : needed)).map(({ key }) => key));
  return [...holes, ...(usesLog(values) && !log ? ["log"] : [])];
}

/** True if the logger's file is needed. @param {Values} values */
export const usesLog = (values) => [values["vacuum.pulsation"], values["vacuum.liner"]].includes("log");

/** Inputs as they would be filled in; what this form has no place for is named. @param {AnalysisInputs} inputs */
export function valuesOf(inputs) {
  /** @type {Values} */
  const values = {};
  const { reference, material, vacuum = {}, plane, heights_mm = [] } = inputs;
  if (reference) choose(values, "reference", typeof reference === "string" ? reference : Object.keys(reference)[0], typeof reference === "string" ? {} : reference);
  if (material?.law) choose(values, "material", material.law, material);
  for (const side of /** @type {const} */ (["pulsation", "liner"])) {
    const source = vacuum[side];
    if (source) choose(values, `vacuum.${side}`, kindOf(source), typeof source === "string" ? {} : source);
  }
  const { offset, lag } = vacuum;
  if (lag) choose(values, "vacuum.clock", "lag", lag);
  else if (offset === LIGHT) choose(values, "vacuum.clock", LIGHT, {});
  else if (offset) choose(values, "vacuum.clock", "offset", offset);
  if (typeof plane === "string") values.plane = plane;
  else if (plane) choose(values, "plane", "own", Object.fromEntries(["x", "y", "z", "nx", "ny", "nz"].map((name, i) => [name, [...plane.point_mm, ...plane.normal][i]])));
  const single = { sought_kpa: inputs.sought_kpa, phases: inputs.phases };
  for (const [name, value] of Object.entries(single)) if (value !== undefined) values[`.${name}`] = String(value);
  HEIGHTS.forEach((key, i) => heights_mm[i] !== undefined && (values[key] = String(heights_mm[i])));
  return { values, dropped: [...(material?.zones ? ["zones"] : []), ...(heights_mm.length > HEIGHTS.length ? ["heights"] : []), ...(usesLog(values) ? ["log"] : [])] };
}

/** @param {VacuumSource} source */
const kindOf = (source) => (typeof source === "string" ? source : "rate_per_min" in source ? "wave" : "constant");

/** @param {Values} values @param {string} path @param {string} kind @param {Record<string, unknown>} numbers */
function choose(values, path, kind, numbers) {
  values[path] = kind;
  for (const [name, value] of Object.entries(numbers)) if (typeof value === "number") values[`${path}.${name}`] = String(value);
}

const parts = () => NAMES.flatMap((name) => GROUPS[name]);
/** @param {Values} values @param {string} key */
const given = (values, key) => (values[key] ?? "").trim() !== "";
/** @param {Values} values @param {string} key */
const one = (values, key) => numberOf(values[key]) ?? undefined;
/** @param {Record<string, unknown>} all */
const known = (all) => Object.fromEntries(Object.entries(all).filter(([, value]) => value !== undefined));
