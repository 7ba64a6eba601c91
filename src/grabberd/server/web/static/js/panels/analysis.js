// The analyses of a capture: asked for with one press, followed, looked at.
import { outdatedMark } from "../analysis/outdated.js";
import { createRequest } from "../analysis/request.js";
import { createResults } from "../analysis/results.js";
import { labelsIn } from "../captures/words.js";
import { statusOf } from "../core/api.js";
import { el, fill, symbol } from "../core/dom.js";
import { everyPage } from "../core/pages.js";

/** @import { Known } from "../core/store.js" */
/** @import { PanelContext } from "./index.js" */
/** @import { AnalysisRow, Capture } from "types/documents" */

export const panel = {
  title: "analysis.title",

  /** @param {HTMLElement} element @param {PanelContext} context */
  mount(element, context) {
    const { t, api, format, may, go, store } = context;
    const { id = "", n } = context.parameters;
    const path = /** @type {const} */ (`/captures/${encodeURIComponent(id)}`);
    const back = el("a", { class: "button plain", href: `#captures/${encodeURIComponent(id)}` }, symbol("back"), t("analysis.back"));
    const title = el("h1", {}, t("analysis.title"));
    const list = el("nav", { class: "row", "aria-label": t("analysis.list"), hidden: true });
    const failed = el("div", { role: "status" });
    const place = el("div", { class: "stack" }, el("div", { class: "card awaited", role: "status", "aria-label": t("analysis.loading") }, el("span"), el("span"), el("span")));
    const asking = el("div");
    /** @type {ReturnType<typeof createResults> | null} */
    let results = null;
    /** @type {ReturnType<typeof createRequest> | null} */
    let request = null;
    let shown = NaN;
    let turn = 0;
    let missed = false;

    async function open() {
      const mine = ++turn;
      missed = false;
      try {
        const [capture, pages] = await Promise.all([api.get(path), everyPage((query) => api.get(`${path}/analyses?${query}`))]);
        if (mine === turn) show(capture, pages.flatMap((page) => page.analyses));
      } catch (problem) {
        if (mine === turn) refused(problem);
      }
    }

    /** @param {Capture} capture @param {AnalysisRow[]} analyses */
    function show(capture, analyses) {
      fill(title, t("analysis.of", { when: format.moment(capture.created_utc) }), labelsIn(context, capture) && ` · ${labelsIn(context, capture)}`);
      const wanted = analyses.find((one) => String(one.analysis) === n) ?? analyses[0];
      fill(list, ...analyses.map((one) => link(one, one === wanted)));
      list.hidden = analyses.length < 2;
      showFailure(capture);
      if (wanted?.analysis !== shown || !results) {
        shown = wanted?.analysis ?? NaN;
        results?.end();
        results = wanted ? createResults(context, capture, wanted) : null;
        fill(place, results?.element ?? el("p", { class: "muted" }, t("analysis.none")));
      }
      if (!request) ask(capture, analyses);
    }

    /** @param {AnalysisRow} one @param {boolean} isShown */
    function link(one, isShown) {
      const run = one.run && one.run > 1 ? ` · ${t("analysis.run", { n: one.run })}` : "";
      return el("a", { class: "button", href: `#analysis/${encodeURIComponent(id)}/${one.analysis}`, "aria-current": isShown ? "page" : null }, t("capture.analysis", { n: one.analysis }), el("span", { class: "muted small" }, one.created_utc && format.moment(one.created_utc), run), outdatedMark(context, one));
    }

    /** Why the last one came to nothing, in full. @param {Capture} capture */
    function showFailure({ analysis }) {
      const problem = analysis?.state === "failed" ? analysis.problem : null;
      fill(failed, problem ? el("div", { class: "note is-bad", data: { failed: "" } }, symbol("bad"), el("div", {}, el("strong", {}, t("analysis.failed")), el("p", { lang: "en" }, problem.message), problem.hint && el("p", { lang: "en" }, problem.hint))) : null);
    }

    /** @param {Capture} capture @param {AnalysisRow[]} analyses */
    function ask(capture, analyses) {
      const why = !may("operator") ? "viewer" : capture.state !== "sealed" ? "notYet" : capture.runs.length ? "" : "noPoints";
      if (why) return fill(asking, el("p", { class: "card muted" }, t(`analysis.${why}`)));
      request = createRequest(context, capture, analyses, made);
      const body = el("div", { class: "stack" }, request.element);
      fill(asking, analyses.length ? el("details", { class: "card analysis-asking" }, el("summary", { class: "capture-summary" }, t("analysis.again")), body) : el("section", { class: "card stack analysis-asking" }, el("h2", {}, t("analysis.new")), body));
    }

    /** It is shown in the place of the last one, which an address with a number does not let go of. @param {number} number */
    function made(number) {
      if (n) return go("analysis", id, String(number));
      request?.unmount();
      request = null;
      open();
    }

    /** @param {unknown} problem */
    function refused(problem) {
      missed = statusOf(problem) === 0; // the banner says that the daemon is away
      if (missed) return;
      if (statusOf(problem) === 404) fill(place, el("div", { class: "note is-warn" }, symbol("warn"), el("p", {}, t("capture.gone"))));
      else context.refused(problem);
    }

    const before = latestOf(store.get(), id);
    element.append(el("div", {}, back, title), list, failed, place, asking);
    open();
    // One that was asked for elsewhere, or that followed the capture by itself, appears by itself; and what a lost link
    // kept from coming.
    const ends = [
      store.subscribe((known) => latestOf(known, id), (now) => void (now !== before && open())),
      store.subscribe((known) => known.connection.online, (online) => void (online && missed && open())),
    ];
    return {
      unmount() {
        turn = NaN;
        ends.forEach((end) => end());
        results?.end();
        request?.unmount();
      },
    };
  },
};

/** Which analysis of a capture ended last, as far as the state tells. @param {Known} known @param {string} id */
function latestOf(known, id) {
  const latest = Object.values(known.state?.devices ?? {}).map(({ latest_analysis: one }) => one);
  return latest.filter((one) => one?.capture === id).map((one) => `${one?.state} ${one?.analysis} ${one?.created_utc}`).join();
}
