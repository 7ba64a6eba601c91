// Further captures of the same liner, which are put together with this one by phase.
import { createChooser } from "../captures/chooser.js";
import { lengthIn, lineOf } from "../captures/words.js";
import { el, fill } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture } from "types/documents" */

const OFFERED = 20;

/** @param {Context} context @param {Capture} capture */
export function createBursts(context, capture) {
  const { t, api } = context;
  const list = el("div");
  const chooser = createChooser(context, { label: t("analysis.bursts.another"), query: { device: capture.device }, choose: (_, one) => one && add(one) });
  const element = el("details", { class: "analysis-group" }, el("summary", { class: "capture-summary" }, t("analysis.bursts.title")), el("p", { class: "field-hint" }, t("analysis.bursts.about")), list, chooser.element);
  element.addEventListener("toggle", offer, { once: true });

  /** Those of the same liner; any other is found by its words. */
  async function offer() {
    const { liner } = capture.labels;
    const asked = new URLSearchParams({ measured: "true", limit: String(OFFERED), device: capture.device, ...(liner ? { label: `liner=${liner}` } : {}) });
    const page = await api.get(`/captures?${asked}`).catch(() => ({ captures: [] }));
    const others = page.captures.filter((one) => one.id !== capture.id && one.state === "sealed");
    fill(list, others.length ? others.map((one) => check(one, false)) : el("p", { class: "muted" }, t("analysis.bursts.none")));
  }

  /** @param {Capture} one */
  function add(one) {
    chooser.show("");
    const known = [...list.querySelectorAll("input")].find((input) => input.value === one.id);
    if (known) known.checked = true;
    else if (one.id !== capture.id) list.append(check(one, true));
  }

  /** @param {Capture} one @param {boolean} checked */
  function check(one, checked) {
    return el("label", { class: "check" }, el("input", { type: "checkbox", value: one.id, checked }), [lineOf(context, one), lengthIn(context, one)].join(" · "));
  }
  return { element, chosen: () => [...list.querySelectorAll("input:checked")].map((input) => /** @type {HTMLInputElement} */ (input).value) };
}
