// A calibration from elsewhere: a JSON file that was taken home before, or made by the command line.
import { ApiProblem } from "../core/api.js";
import { el, fill, symbol } from "../core/dom.js";
import { note } from "./steps.js";

/** @import { Context } from "../core/context.js" */

/** @param {Context} context @param {() => void} changed */
export function createImport(context, changed) {
  const { t, api } = context;
  const said = el("div", { role: "status" });
  const file = el("input", { class: "input", type: "file", id: "import-file", accept: ".json,application/json", on: { change: take } });
  const element = el("details", { class: "card import" }, el("summary", {}, symbol("down"), t("calibration.import.title")),
    el("div", { class: "field" }, el("label", { class: "field-label", for: "import-file" }, t("calibration.import.file")), file, el("p", { class: "field-hint" }, t("calibration.import.hint"))), said);

  async function take() {
    const chosen = file.files?.[0];
    if (!chosen) return;
    fill(said);
    const document = await read(chosen);
    if (document === null) fill(said, note("bad", t("calibration.import.noJson", { name: chosen.name })));
    else await store(document, chosen.name);
    file.value = "";
  }

  /** @param {Record<string, unknown>} document @param {string} name */
  async function store(document, name) {
    try {
      await api.post("/calibrations", { body: { document, device: context.device()?.name, note: name } });
      fill(said, note("good", t("calibration.import.done")));
      changed();
    } catch (problem) {
      const { detail = "", hint = "" } = problem instanceof ApiProblem ? problem : {};
      fill(said, note("bad", el("strong", {}, detail || t("core.noAnswer")), el("p", {}, hint)));
    }
  }

  return { element };
}

/** @param {File} file */
async function read(file) {
  try {
    const document = JSON.parse(await file.text());
    return document !== null && typeof document === "object" && !Array.isArray(document) ? document : null;
  } catch {
    return null;
  }
}
