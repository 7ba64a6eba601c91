// Choice of the subject, live or a capture, and of the view: in space or over time.
import { labelsIn } from "../captures/words.js";
import { el, fill } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture } from "types/documents" */

const LISTED = 50;

/** @typedef {{id: string, created_utc: string | null, labels: Record<string, string>, note: string}} Named a capture, or one that is only known by its id */

/**
 * @param {Context} context
 * @param {"shape" | "plots"} way which of them this is
 * @param {string | undefined} id of the capture; live without one
 */
export function createSubjectBar(context, way, id) {
  const { t, api, go } = context;
  const titles = { shape: t("shape.title"), plots: t("plots.title") };
  const tabs = { shape: t("shape.tab"), plots: t("plots.tab") };
  const select = el("select", { class: "input", id: "subject", on: { change: () => go(...[way, select.value].filter(Boolean)) } });
  const link = (/** @type {"shape" | "plots"} */ one) =>
    el("a", { class: "button", href: `#${[one, id].filter(Boolean).map((part) => encodeURIComponent(String(part))).join("/")}`, "aria-current": one === way ? "page" : null }, tabs[one]);
  const element = el(
    "header", { class: "subject-bar" },
    el("h1", {}, titles[way]),
    el("div", { class: "field subject-choice" }, el("label", { class: "field-label", for: "subject" }, t("shape.subject")), select),
    el("nav", { class: "row", "aria-label": t("shape.ways") }, link("shape"), link("plots")),
  );

  /** @param {Capture[]} captures */
  function list(captures) {
    const others = id && !captures.some((one) => one.id === id) ? [/** @type {Named} */ ({ id, created_utc: null, labels: {}, note: "" })] : [];
    const options = [...others, ...captures].map((one) => el("option", { value: one.id, selected: one.id === id }, nameOf(context, one)));
    fill(select, el("option", { value: "", selected: !id }, t("shape.live")), options);
  }

  list([]);
  api.get(`/captures?limit=${LISTED}`).then((page) => list(page.captures.filter((one) => one.runs.length)), context.refused);
  return element;
}

/** A capture in a line. @param {Context} context @param {Named} capture */
export function nameOf(context, capture) {
  const { format } = context;
  const said = [labelsIn(context, capture), capture.note].filter(Boolean).join(", ");
  return [capture.created_utc ? format.moment(capture.created_utc) : capture.id, said].filter(Boolean).join(" · ");
}
