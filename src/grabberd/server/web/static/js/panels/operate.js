// One glance, and the two buttons that matter.
import { el } from "../core/dom.js";
import { createLater } from "../core/later.js";
import { createLights } from "../lights/lights.js";
import { createForm } from "../operate/form.js";
import { createLastCapture } from "../operate/last_capture.js";
import { createStartStop } from "../operate/start_stop.js";
import { createStateCard } from "../operate/state_card.js";

/** @import { Context } from "../core/context.js" */

/** Enough to see that the picture lives; where it is set up it comes twice as often. */
const GLANCE_HZ = 12.5;

export const panel = {
  title: "operate.title",

  /** @param {HTMLElement} element @param {Context} context */
  mount(element, context) {
    const form = createForm(context, { changed: () => buttons.show(), labelled: () => last.look() });
    const state = createStateCard(context);
    const last = createLastCapture(context);
    const buttons = createStartStop(context, form);
    const picture = createLater(context, emptyFinder(context), async () => {
      const { createViewfinder } = await import("../live/viewfinder.js");
      return () => createViewfinder(context, { rate_hz: GLANCE_HZ });
    });
    const curves = createLater(context, el("section", { class: "curves", hidden: true }), async () => (await import("../live/curves.js")).createCurves);
    const lights = createLights(context);
    element.append(
      el("div", { class: "operate-main" }, state.element, buttons.element, lights.alerts, last.element, form.element),
      el("div", { class: "operate-side" }, picture.element, curves.element, lights.element),
    );
    const parts = [state, buttons, last, form, picture, curves, lights];
    return { unmount: () => parts.forEach((part) => part.unmount?.()) };
  },
};

/** As large as the picture, so that nothing moves when it comes. @param {Context} context */
function emptyFinder({ t }) {
  const canvas = el("canvas", { class: "picture-canvas", width: 720, height: 576, "aria-hidden": true });
  return el("section", { class: "card viewfinder", "aria-busy": true }, el("div", { class: "row between" }, el("h2", {}, t("live.picture"))), el("div", { class: "picture veiled" }, canvas));
}
