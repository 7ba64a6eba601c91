// One analysis: what was found, curves, maps, files.
import { el, fill, symbol } from "../core/dom.js";
import { periodOf } from "../captures/words.js";
import { addressOf } from "../profiles/words.js";
import { createCurves } from "./curves.js";
import { createFiles, createReportLink } from "./files.js";
import { createFound } from "./found.js";
import { createMaps } from "./maps.js";
import { outdatedNote } from "./outdated.js";

/** @import { Context } from "../core/context.js" */
/** @import { AnalysisRow, Capture } from "types/documents" */

/** @param {Context} context @param {Capture} capture @param {AnalysisRow} record of the analysis */
export function createResults(context, capture, record) {
  const { t, api } = context;
  const path = /** @type {const} */ (`/captures/${encodeURIComponent(capture.id)}/analyses/${record.analysis}`);
  const element = el("div", { class: "stack", data: { analysis: record.analysis } }, el("div", { class: "card awaited", role: "status", "aria-label": t("analysis.loading") }, el("span"), el("span"), el("span")));
  /** @type {{end: () => void}[]} */
  let parts = [];
  let ended = false;

  async function open() {
    if (record.problem) return fill(element, el("div", { class: "note is-bad" }, symbol("bad"), el("p", {}, record.problem)));
    const document = await api.get(path).catch(context.refused);
    if (ended || !document) return;
    const curves = createCurves(context, document, `${capture.id}-analysis-${record.analysis}`, periodOf(capture));
    const maps = createMaps(context, path, document, periodOf(capture));
    parts = [curves, maps];
    const found = el("section", { class: "card stack" }, el("div", { class: "row between" }, el("h2", {}, t("analysis.found")), createReportLink(context, path, record)), createFound(context, capture, document, record), inputs());
    fill(element, outdatedNote(context, record), el("div", { class: "analysis-page" }, found, maps.element), curves.element, createFiles(context, path));
  }

  /** The inputs exactly as they were given. */
  function inputs() {
    const bursts = record.bursts?.length ? el("p", {}, `${t("analysis.bursts.title")}: ${record.bursts.join(", ")}`) : null;
    const used = (record.profiles ?? []).map((one) => el("a", { href: addressOf(one.kind, one.name) }, `${t(`profiles.kind.${one.kind}`)} ${one.name}, ${t("profiles.version", { n: one.version })}`));
    const profiles = used.length ? el("p", { data: { profiles: "" } }, `${t("profiles.title")}: `, used.flatMap((one, at) => (at ? [", ", one] : [one]))) : null;
    return el("details", {}, el("summary", { class: "capture-summary" }, t("analysis.given")), profiles, el("pre", { class: "analysis-given scroll", tabindex: 0 }, JSON.stringify(record.inputs, null, 2)), bursts);
  }

  open();
  return {
    element,
    end() {
      ended = true;
      parts.forEach((part) => part.end());
    },
  };
}
