// The analyses of a capture, in a line each.
import { outdatedMark } from "../analysis/outdated.js";
import { el, fill, symbol } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture } from "types/documents" */

const SHOWN = 4;

/** @param {Context} context */
export function createAnalyses(context) {
  const { t, api, format } = context;
  const list = el("ul", { class: "analysis-links" });
  const element = el("section", { class: "card stack", hidden: true }, el("h2", {}, t("capture.analyses")), list);

  /** @param {Capture} capture */
  async function show(capture) {
    const found = await api.get(`/captures/${encodeURIComponent(capture.id)}/analyses`).catch(() => ({ analyses: [] }));
    element.hidden = !found.analyses.length;
    fill(list, ...found.analyses.slice(0, SHOWN).map((one) => el("li", {}, el("a", { class: "button", href: `#analysis/${encodeURIComponent(capture.id)}/${one.analysis}` }, symbol("maps"), t("capture.analysis", { n: one.analysis })), " ", el("span", { class: "muted small" }, one.created_utc && format.moment(one.created_utc)), " ", outdatedMark(context, one))));
  }
  return { element, show };
}
