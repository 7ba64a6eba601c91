// Calibration: what is active, and the guided way from the calibration frame to an accepted calibration.
import { createAdjust } from "../calibration/adjust.js";
import { createFound } from "../calibration/found.js";
import { createOverview } from "../calibration/overview.js";
import { createPlace } from "../calibration/place.js";
import { createReview } from "../calibration/review.js";
import { createSteps, remember } from "../calibration/steps.js";
import { createTake } from "../calibration/take.js";
import { el, symbol } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { PanelContext } from "./index.js" */

const VIEWS = /** @type {Record<string, (context: Context, id: string) => {element: HTMLElement, unmount: () => void}>} */ ({
  place: createPlace, take: createTake, found: createFound, adjust: createAdjust, review: createReview,
});
const NEEDS_ID = new Set(["found", "adjust", "review"]);

export const panel = {
  title: "calibration.title",

  /** @param {HTMLElement} element @param {PanelContext} context */
  mount(element, context) {
    const { step = "", id = "" } = context.parameters;
    const title = el("h1", {}, context.t("calibration.title"));
    if (!VIEWS[step] || (NEEDS_ID.has(step) && !id)) {
      const overview = createOverview(context);
      element.append(title, overview.element);
      return overview;
    }
    if (step !== "review" && context.may("operator")) remember(step, id);
    const view = VIEWS[step](context, id);
    const back = el("a", { class: "button plain", href: "#calibration" }, symbol("back"), context.t("calibration.overview"));
    element.append(el("div", { class: "row between" }, title, back), createSteps(context, step), view.element);
    return view;
  },
};
