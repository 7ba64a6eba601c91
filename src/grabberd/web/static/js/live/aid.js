// For who sets lamp and lens: the threshold, and what each view shows at it.
import { el, setText } from "../core/dom.js";
import { delivers, deviceOf } from "../core/store.js";
import { createHistogram } from "./histogram.js";
import { createThreshold } from "./threshold.js";

/** @import { Context } from "../core/context.js" */
/** @import { ViewIllumination } from "types/documents" */

const EVERY_MS = 500;
const CLIPPED = 0.5;

/** @param {Context} context */
export function createAid(context) {
  const { t, store, api } = context;
  const views = { left: createView(context, "left"), right: createView(context, "right") };
  const threshold = createThreshold(context);
  const element = el("section", { class: "card aid", "aria-labelledby": "aid-title" },
    el("h2", { id: "aid-title" }, t("live.aid.title")), el("p", { class: "muted" }, t("live.aid.hint")),
    threshold.element, el("div", { class: "aid-views" }, views.left.element, views.right.element));
  let timer = 0;
  let ended = false;

  async function look() {
    const device = deviceOf(store.get());
    if (!delivers(device)) showNone();
    else if (store.get().connection.online && document.visibilityState === "visible") await ask(device.name);
    if (!ended) timer = setTimeout(look, EVERY_MS);
  }

  /** @param {string} device */
  async function ask(device) {
    try {
      const light = await api.get(`/devices/${encodeURIComponent(device)}/light`);
      for (const [name, view] of Object.entries(views)) view.show(light.views[name], light.threshold);
      threshold.show(light.threshold);
    } catch {
      showNone();
    }
  }

  /** The lights say why. */
  function showNone() {
    for (const view of Object.values(views)) view.show(null, 0);
  }

  look();
  return {
    element,
    unmount() {
      ended = true;
      clearTimeout(timer);
      threshold.unmount();
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
    if (light) histogram.draw(light.histogram, threshold);
  }

  return { element, show };
}
