// The analyses of a capture: asked for, followed, looked at.
import { outdatedMark } from "../analysis/outdated.js";
import { createRequest } from "../analysis/request.js";
import { createResults } from "../analysis/results.js";
import { labelsIn } from "../captures/words.js";
import { statusOf } from "../core/api.js";
import { el, fill, symbol } from "../core/dom.js";

/** @import { PanelContext } from "./index.js" */
/** @import { AnalysisRow, Capture } from "types/documents" */

export const panel = {
  title: "analysis.title",

  /** @param {HTMLElement} element @param {PanelContext} context */
  mount(element, context) {
    const { t, api, format, may, go } = context;
    const { id = "", n } = context.parameters;
    const path = /** @type {const} */ (`/captures/${encodeURIComponent(id)}`);
    const back = el("a", { class: "button plain", href: `#captures/${encodeURIComponent(id)}` }, symbol("back"), t("analysis.back"));
    const title = el("h1", {}, t("analysis.title"));
    const list = el("nav", { class: "row", "aria-label": t("analysis.list") });
    const place = el("div", { class: "stack" });
    const asking = el("details", { class: "card analysis-asking" });
    /** @type {ReturnType<typeof createResults> | null} */
    let results = null;
    /** @type {ReturnType<typeof createRequest> | null} */
    let request = null;
    let ended = false;

    async function open() {
      const [capture, listed] = await Promise.all([api.get(path), api.get(`${path}/analyses`)]);
      if (ended) return;
      fill(title, t("analysis.of", { when: format.moment(capture.created_utc) }), labelsIn(context, capture) && ` · ${labelsIn(context, capture)}`);
      const { analyses } = listed;
      const shown = analyses.find((one) => String(one.analysis) === n) ?? analyses[0];
      fill(list, ...analyses.map((one) => link(one, one === shown)));
      list.hidden = !analyses.length;
      results = shown ? createResults(context, capture, shown) : null;
      fill(place, results?.element ?? el("p", { class: "muted" }, t("analysis.none")));
      ask(capture, analyses);
    }

    /** @param {AnalysisRow} one @param {boolean} isShown */
    function link(one, isShown) {
      return el("a", { class: "button", href: `#analysis/${encodeURIComponent(id)}/${one.analysis}`, "aria-current": isShown ? "page" : null }, t("capture.analysis", { n: one.analysis }), el("span", { class: "muted small" }, one.created_utc && format.moment(one.created_utc)), outdatedMark(context, one));
    }

    /** @param {Capture} capture @param {AnalysisRow[]} analyses */
    function ask(capture, analyses) {
      if (!may("operator")) return fill(asking, el("summary", { class: "capture-summary" }, t("analysis.new")), el("p", {}, t("analysis.viewer")));
      if (capture.state !== "sealed" || !capture.runs.length) return fill(asking, el("summary", { class: "capture-summary" }, t("analysis.new")), el("p", {}, t(capture.runs.length ? "analysis.notYet" : "analysis.noPoints")));
      request = createRequest(context, capture, analyses, (number) => go("analysis", id, String(number)));
      asking.open = !analyses.length;
      fill(asking, el("summary", { class: "capture-summary" }, t("analysis.new")), request.element);
    }

    /** @param {unknown} problem */
    function refused(problem) {
      if (statusOf(problem) === 404) fill(place, el("div", { class: "note is-warn" }, symbol("warn"), el("p", {}, t("capture.gone"))));
      else context.refused(problem);
    }

    element.append(el("div", {}, back, title), list, place, asking);
    open().catch(refused);
    return {
      unmount() {
        ended = true;
        results?.end();
        request?.unmount();
      },
    };
  },
};
