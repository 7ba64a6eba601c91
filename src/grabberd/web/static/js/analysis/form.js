// The questions of an analysis: each with its unit and a word what it is. What is left empty is not computed.
import { el, fill, symbol } from "../core/dom.js";
import { GROUPS, NAMES } from "./fields.js";
import { ENDS, askedOf, inputsOf, keyOf, lacksOf, missingOf, usesLog } from "./inputs.js";

/** @import { Context } from "../core/context.js" */
/** @import { Asked, Part } from "./fields.js" */
/** @import { Values } from "./inputs.js" */

/**
 * @param {Context} context
 * @param {() => void} changed
 * @param {() => Set<string>} given inputs that come from elsewhere, by the names of what lacks without them
 */
export function createForm(context, changed, given) {
  const { t } = context;
  /** @type {Values} */
  let values = {};
  let log = "";
  const file = el("input", { class: "input", type: "file", accept: ".csv,.txt,text/csv", on: { change: read } });
  const logged = el("label", { class: "field", hidden: true, data: { asked: "log" } }, el("span", { class: "field-label" }, t("analysis.log.label")), file, el("span", { class: "field-hint" }, t("analysis.log.about")));
  const bodies = Object.fromEntries(NAMES.map((name) => [name, el("div", { class: "stack" })]));
  const lacks = Object.fromEntries(NAMES.map((name) => [name, el("p", { class: "analysis-lack" })]));
  const element = el("div", { class: "stack" }, NAMES.map(group));

  /** @param {string} name */
  function group(name) {
    const about = el("p", { class: "field-hint" }, t(`analysis.group.${name}.about`));
    return el("fieldset", { class: "analysis-group", data: { group: name } }, el("legend", {}, t(`analysis.group.${name}.title`)), about, lacks[name], bodies[name], name === "vacuum" && logged);
  }

  async function read() {
    log = file.files?.[0] ? await file.files[0].text() : "";
    tell();
  }

  /** @param {Part} part */
  function partOf(part) {
    const numbers = el("div", { class: "analysis-numbers" });
    const refill = () => fill(numbers, ...askedOf(part, values).map((asked) => numberOf(keyOf(part, asked.name), asked)));
    refill();
    if (!part.kinds) return numbers;
    const options = ["", ...part.kinds].map((kind) => el("option", { value: kind, selected: kind === (values[part.path] ?? "") }, kind ? t(`analysis.kind.${part.path.split(".").pop()}.${kind}`) : t("analysis.notGiven")));
    const select = el("select", { class: "input", data: { part: part.path } }, options);
    select.addEventListener("change", () => {
      values[part.path] = select.value;
      refill();
      tell();
    });
    return el("div", { class: "analysis-part" }, el("label", { class: "field" }, el("span", { class: "field-label" }, t(`analysis.part.${part.path.split(".").pop()}`)), select), numbers);
  }

  /** @param {string} key @param {Asked} asked */
  function numberOf(key, { name, unit, free }) {
    const input = el("input", { class: "input", type: "number", step: "any", inputmode: "decimal", value: values[key] ?? "", data: { asked: key } });
    input.addEventListener("input", () => {
      values[key] = input.value;
      tell();
    });
    const label = t(`analysis.number.${name}.label`);
    return el("label", { class: "field" }, el("span", { class: "field-label" }, label, unit && el("span", { class: "muted" }, ` ${unit}`), free && el("span", { class: "muted" }, ` · ${t("analysis.optional")}`)), input, el("span", { class: "field-hint" }, t(`analysis.number.${name}.about`)));
  }

  function tell() {
    logged.hidden = !usesLog(values);
    const known = given();
    const without = lacksOf(values).filter((lack) => !known.has(lack));
    for (const name of NAMES) {
      const words = without.filter((lack) => groupOf(lack) === name).map((lack) => t(`analysis.lack.${lack}`));
      lacks[name].hidden = !words.length;
      fill(lacks[name], symbol("info"), el("span", {}, [...new Set(words)].join(" ")));
    }
    changed();
  }

  /** @param {Values} wanted */
  function set(wanted) {
    values = { ...wanted };
    for (const name of NAMES) fill(bodies[name], ...GROUPS[name].map(partOf));
    tell();
  }

  set({});
  return {
    element, set, tell,
    request: () => ({ inputs: inputsOf(values), ...(usesLog(values) ? { vacuum_log: log } : {}) }),
    /** Labels of the inputs that are still missing. */
    missing: () => missingOf(values, log).map((key) => (key === "log" ? t("analysis.log.label") : t(`analysis.number.${key.split(".").pop()}.label`))),
  };
}

/** In which group something is that lacks. @param {string} lack */
const groupOf = (lack) => ({ [ENDS]: "material", vacuum_pulsation: "vacuum", vacuum_liner: "vacuum", sought_kpa: "pressure", plane: "sections" })[lack] ?? lack;
