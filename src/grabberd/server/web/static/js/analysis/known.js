// What is known for an analysis, as a short list: name, value with σ, source. Nothing here touches the page.
import { addressOf } from "../profiles/words.js";
import { el } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { AnalysisPreparation } from "types/documents" */
/** @import { AnalysisInputs, VacuumSource } from "types/open_documents" */
/** @import { Child } from "types/elements" */

/** Of the wall: what matters most. */
const WALL = /** @type {const} */ ([["E_mpa", "E_sigma_mpa", "MPa"], ["wall_mm", "wall_sigma_mm", "mm"], ["radius_mm", "", "mm"], ["F0_n", "F0_sigma_n", "N"]]);
const PROFILE = /^(liner|pulsator|cup|cow) profile (.+), version (\d+)$/;

/** @typedef {{name: string, label: string, value: string, source: Child}} Known */

/** @param {Context} context @param {AnalysisPreparation} found @returns {Known[]} */
export function knownIn(context, found) {
  const { t } = context;
  const inputs = /** @type {AnalysisInputs} */ (found.inputs);
  const sourced = (/** @type {string} */ name, /** @type {string} */ label, /** @type {string} */ value) => ({ name, label, value, source: sourceIn(context, found, name) });
  return [
    ...wallOf(context, found),
    ...chambersOf(context, found),
    ...(inputs.reference ? [sourced("reference", t("analysis.group.reference.title"), referenceIn(context, inputs.reference))] : []),
    ...(inputs.sought_kpa !== undefined ? [sourced("sought_kpa", t("analysis.number.sought_kpa.label"), `${numberIn(context, inputs.sought_kpa)} kPa`)] : []),
    ...(inputs.plane ? [sourced("plane", t("analysis.part.plane"), t(`analysis.kind.plane.${typeof inputs.plane === "string" ? "symmetry" : "own"}`))] : []),
    ...(inputs.flow_stop ? [sourced("flow_stop", t("analysis.known.flow_stop"), spreadOf(context, inputs.flow_stop.kpa, inputs.flow_stop.sigma_kpa, "kPa"))] : []),
  ];
}

/** @param {Context} context @param {AnalysisPreparation} found @returns {Known[]} */
function wallOf(context, found) {
  const { t } = context;
  const { material } = /** @type {AnalysisInputs} */ (found.inputs);
  if (!material) return [];
  const source = () => sourceIn(context, found, "material");
  if (material.zones) return [{ name: "material", label: t("analysis.group.material.title"), value: t("analysis.known.zones"), source: source() }];
  return WALL.filter(([name]) => typeof material[name] === "number").map(([name, sigma, unit]) => ({
    name: `material.${name}`, label: t(`analysis.number.${name}.label`),
    value: spreadOf(context, Number(material[name]), /** @type {number | undefined} */ (material[sigma]), unit),
    source: [source(), found.obtained?.[name] ? `, ${found.obtained[name]}` : ""],
  }));
}

/** @param {Context} context @param {AnalysisPreparation} found @returns {Known[]} */
function chambersOf(context, found) {
  const vacuum = /** @type {AnalysisInputs} */ (found.inputs).vacuum ?? {};
  const chambers = /** @type {const} */ (["pulsation", "liner"]);
  return chambers.flatMap((name) => {
    const source = vacuum[name];
    return source ? [{ name: `vacuum.${name}`, label: context.t(`analysis.known.${name}`), value: vacuumIn(context, source), source: sourceIn(context, found, `vacuum.${name}`) }] : [];
  });
}

/** @param {Context} context @param {VacuumSource} source */
function vacuumIn(context, source) {
  const { t } = context;
  if (typeof source === "string" || "channel" in source) return t("analysis.known.measured");
  if (!("rate_per_min" in source)) return spreadOf(context, source.kpa, source.sigma_kpa, "kPa");
  const share = Math.round(100 * source.ratio);
  return t("analysis.known.wave", { rate: numberIn(context, source.rate_per_min), on: share, off: 100 - share, kpa: spreadOf(context, source.system_kpa, source.sigma_kpa, "kPa") });
}

/** @param {Context} context @param {NonNullable<AnalysisInputs["reference"]>} reference */
function referenceIn(context, reference) {
  if (typeof reference === "string") return context.t("analysis.kind.reference.nominal");
  const [[kind, value]] = Object.entries(reference);
  return kind === "phase" ? context.t("analysis.known.phase", { phase: numberIn(context, 100 * value) }) : context.t("analysis.known.field", { n: value });
}

/** Where an input comes from: a profile with a link, what was recorded, the configuration, this form. @param {Context} context @param {AnalysisPreparation} found @param {string} name @returns {Child} */
function sourceIn(context, found, name) {
  const { t } = context;
  const said = found.sources?.[name] ?? found.sources?.[name.split(".")[0]] ?? "";
  const profile = PROFILE.exec(said);
  if (profile) return el("a", { href: addressOf(profile[1], profile[2]) }, `${t(`profiles.kind.${profile[1]}`)} ${profile[2]}, ${t("profiles.version", { n: profile[3] })}`);
  if (said) return said.startsWith("the configuration's") ? t("analysis.known.configured") : said;
  const [, chamber] = name.split(".");
  const recorded = /** @type {AnalysisInputs} */ (found.inputs).vacuum;
  return name.startsWith("vacuum.") && recorded?.[/** @type {"pulsation" | "liner"} */ (chamber)] === "channel" ? t("analysis.known.recorded") : t("analysis.known.here");
}

/** "3.0 ± 0.1 MPa", to the second digit of its σ. @param {Context} context @param {number} value @param {number | null | undefined} sigma @param {string} unit */
function spreadOf({ format }, value, sigma, unit) {
  const digits = sigma ? Math.min(6, Math.max(0, 1 - Math.floor(Math.log10(sigma)))) : placesOf(value);
  return `${format.number(value, digits)}${sigma ? ` ± ${format.number(sigma, digits)}` : ""} ${unit}`;
}

/** As it was given. @param {Context} context @param {number} value */
const numberIn = ({ format }, value) => format.number(value, placesOf(value));
/** @param {number} value */
const placesOf = (value) => Math.min(4, (String(Math.round(value * 1e4) / 1e4).split(".")[1] ?? "").length);
