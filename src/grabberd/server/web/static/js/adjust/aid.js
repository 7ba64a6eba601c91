// For who sets lamp and lens: the threshold, and what each view shows at it.
import { el, setText } from "../core/dom.js";
import { createFocus } from "./focus.js";
import { createHistogram } from "./histogram.js";
import { createThreshold } from "./threshold.js";

/** @import { Context } from "../core/context.js" */
/** @import { Illumination, ViewIllumination } from "types/documents" */

const OLD_MS = 1500;
const CLIPPED = 0.5;

/** @param {Context} context */
export function createAid(context) {
  const { t } = context;
  const views = { left: createView(context, "left"), right: createView(context, "right") };
  const focus = createFocus(context);
  const threshold = createThreshold(context);
  const element = el("section", { class: "card aid", "aria-labelledby": "aid-title" },
    el("h2", { id: "aid-title" }, t("live.aid.title")), el("p", { class: "muted" }, t("live.aid.hint")),
    focus.element, threshold.element, el("div", { class: "aid-views" }, views.left.element, views.right.element));
  let timer = 0;

  /** @param {Illumination} light */
  function lit(light) {
    for (const [name, view] of Object.entries(views)) view.show(light.views[name], light.threshold);
    threshold.show(light.threshold);
    focus.show(light);
    clearTimeout(timer);
    timer = setTimeout(showNone, OLD_MS);
  }

  /** No number stays that is not of now; the veil over the picture says why. */
  function showNone() {
    for (const view of Object.values(views)) view.show(null, 0);
    focus.show(null);
  }

  showNone();
  return {
    element, lit,
    unmount() {
      clearTimeout(timer);
      threshold.unmount();
      focus.unmount();
    },
  };
}

/** @param {Context} context @param {"left" | "right"} name */
function createView({ t, format }, name) {
  const title = t(`live.view.${name}`);
  const histogram = createHistogram(t("live.aid.histogram", { view: title }));
  const values = { targets: el("dd"), size: el("dd"), bright: el("dd"), dark: el("dd") };
  const facts = Object.entries(values).map(([key, value]) => [el("dt", {}, t(`live.aid.${key}`)), value]);
  const warning = el("p", { class: "note is-warn", hidden: true }, t("live.aid.clipped"));
  const element = el("div", { class: "aid-view", data: { view: name } }, el("h3", {}, title), histogram.element, el("dl", { class: "facts number" }, facts), warning);

  /** @param {ViewIllumination | null} light @param {number} threshold */
  function show(light, threshold) {
    setText(values.targets, light ? format.number(light.targets) : "–");
    setText(values.size, light?.diameter_px ? t("live.aid.px", { px: format.number(light.diameter_px, 1) }) : "–");
    setText(values.bright, light ? format.number(light.brightest) : "–");
    setText(values.dark, light ? format.number(light.background) : "–");
    warning.hidden = !light || light.clipped <= CLIPPED;
    histogram.draw(light?.histogram ?? [], threshold);
  }

  return { element, show };
}
