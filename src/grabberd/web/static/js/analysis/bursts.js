// Further captures of the same liner, which are put together with this one by phase.
import { labelsIn, lengthIn } from "../captures/words.js";
import { el, fill } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture } from "types/documents" */

const OFFERED = 20;

/** @param {Context} context @param {Capture} capture */
export function createBursts(context, capture) {
  const { t, api, format } = context;
  const list = el("div");
  const element = el("details", { class: "analysis-group" }, el("summary", { class: "capture-summary" }, t("analysis.bursts.title")), el("p", { class: "field-hint" }, t("analysis.bursts.about")), list);
  element.addEventListener("toggle", offer, { once: true });

  async function offer() {
    const page = await api.get(`/captures?limit=${OFFERED}&device=${encodeURIComponent(capture.device)}`).catch(() => ({ captures: [] }));
    const others = page.captures.filter((one) => one.id !== capture.id && one.runs.length && one.state === "sealed");
    fill(list, others.length ? others.map(check) : el("p", { class: "muted" }, t("analysis.bursts.none")));
  }

  /** @param {Capture} one */
  function check(one) {
    const words = [format.moment(one.created_utc), labelsIn(context, one), lengthIn(context, one)].filter(Boolean).join(" · ");
    return el("label", { class: "check" }, el("input", { type: "checkbox", value: one.id }), words);
  }
  return { element, chosen: () => [...list.querySelectorAll("input:checked")].map((input) => /** @type {HTMLInputElement} */ (input).value) };
}
