// One glance, and the two buttons that matter.
import { el } from "../core/dom.js";
import { createLights } from "../lights/lights.js";
import { createViewfinder } from "../live/viewfinder.js";
import { createForm } from "../operate/form.js";
import { createLastCapture } from "../operate/last_capture.js";
import { createStartStop } from "../operate/start_stop.js";
import { createStateCard } from "../operate/state_card.js";

/** @import { Context } from "../core/context.js" */

export const panel = {
  title: "operate.title",

  /** @param {HTMLElement} element @param {Context} context */
  mount(element, context) {
    const form = createForm(context, () => buttons.show());
    const state = createStateCard(context);
    const last = createLastCapture(context);
    const buttons = createStartStop(context, form);
    const picture = createViewfinder(context, { buttons: false });
    const lights = createLights(context);
    element.append(
      el("div", { class: "operate-main" }, state.element, buttons.element, lights.alerts, last.element, form.element),
      el("div", { class: "operate-side" }, picture.element, lights.element),
    );
    const parts = [state, buttons, last, form, picture, lights];
    return { unmount: () => parts.forEach((part) => part.unmount?.()) };
  },
};
