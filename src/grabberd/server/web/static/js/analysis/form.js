// The questions of an analysis: each with its unit and a word what it is. What is left empty is not computed.
import { el, fill } from "../core/dom.js";
import { createNumberField } from "../core/number_field.js";
import { textOf } from "../core/text_file.js";
import { GROUPS, NAMES } from "./fields.js";
import { askedOf, inputsOf, keyOf, missingOf, usesLog } from "./inputs.js";

/** @import { Context } from "../core/context.js" */
/** @import { Asked, Part } from "./fields.js" */
/** @import { Values } from "./inputs.js" */

/** @param {Context} context @param {() => void} changed */
export function createForm(context, changed) {
  const { t } = context;
  /** @type {Values} */
  let values = {};
  let log = "";
  const file = el("input", { class: "input", type: "file", accept: ".csv,.txt,text/csv", on: { change: read } });
  const unread = el("span", { class: "field-problem", role: "alert", hidden: true }, t("analysis.log.encoding"));
  const logged = el("label", { class: "field", hidden: true, data: { asked: "log" } }, el("span", { class: "field-label" }, t("analysis.log.label")), file, unread, el("span", { class: "field-hint" }, t("analysis.log.about")));
  const bodies = Object.fromEntries(NAMES.map((name) => [name, el("div", { class: "stack" })]));
  const element = el("div", { class: "stack" }, NAMES.map(group));

  /** @param {string} name */
  function group(name) {
    return el("fieldset", { class: "analysis-group", data: { group: name } }, el("legend", {}, t(`analysis.group.${name}.title`)), bodies[name], name === "vacuum" && logged);
  }

  async function read() {
    const text = file.files?.[0] ? await textOf(file.files[0]).catch(() => null) : "";
    unread.hidden = text !== null;
    log = text ?? "";
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
    const attributes = { class: "input", id: `asked-${key}`, value: values[key] ?? "", data: { asked: key } };
    const { input, problem } = createNumberField(context, attributes, (_, typed) => {
      values[key] = typed;
      tell();
    });
    const label = t(`analysis.number.${name}.label`);
    return el("label", { class: "field" }, el("span", { class: "field-label" }, label, unit && el("span", { class: "muted" }, ` ${unit}`), free && el("span", { class: "muted" }, ` · ${t("analysis.optional")}`)), input, problem, el("span", { class: "field-hint" }, t(`analysis.number.${name}.about`)));
  }

  function tell() {
    logged.hidden = !usesLog(values);
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
    element, set,
    values: () => ({ ...values }),
    request: () => ({ inputs: inputsOf(values), ...(usesLog(values) ? { vacuum_log: log } : {}) }),
    /** Labels of the inputs that are still missing. */
    missing: () => missingOf(values, log).map((key) => (key === "log" ? t("analysis.log.label") : t(`analysis.number.${key.split(".").pop()}.label`))),
  };
}
