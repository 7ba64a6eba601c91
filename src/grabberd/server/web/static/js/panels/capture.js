// One capture, with all that there is of it.
import { createAnalyses } from "../capture/analyses.js";
import { createDownloads } from "../capture/downloads.js";
import { createHead } from "../capture/head.js";
import { createKeep } from "../capture/keep.js";
import { createLabels } from "../capture/labels.js";
import { createRuns } from "../capture/runs.js";
import { sampleOf } from "../capture/sample.js";
import { captureWithLedger } from "../capture/ledger.js";
import { createStrip } from "../capture/strip.js";
import { atRest } from "../captures/words.js";
import { statusOf } from "../core/api.js";
import { el, fill, symbol } from "../core/dom.js";

/** @import { PointSample } from "../capture/sample.js" */
/** @import { PanelContext } from "./index.js" */
/** @import { Capture } from "types/documents" */

const EVERY_MS = 1000;

export const panel = {
  title: "capture.title",

  /** @param {HTMLElement} element @param {PanelContext} context */
  mount(element, context) {
    const { t, api } = context;
    const { id = "" } = context.parameters;
    const path = /** @type {const} */ (`/captures/${encodeURIComponent(id)}`);
    const head = createHead(context);
    const strip = createStrip(context, (n) => context.go("replay", id, String(n)));
    const runs = createRuns(context, load);
    const labels = createLabels(context, show);
    const keep = createKeep(context, show);
    const downloads = createDownloads(context);
    const analyses = createAnalyses(context);
    const fields = el("section", { class: "card stack" }, el("h2", {}, t("capture.fields")), el("p", { class: "muted" }, t("capture.fieldsHint")), strip.element);
    // Nothing can be pressed before it is known of which capture, and in which state that is.
    const parts = el("div", { class: "capture-parts", hidden: true }, el("div", { class: "stack" }, fields, labels.element), el("div", { class: "stack" }, downloads.element, runs.element, analyses.element, keep.element));
    /** @type {PointSample | null} */
    let sample = null;
    /** @type {Capture | null} */
    let shown = null;
    let timer = 0;
    let turn = 0;

    /** @param {Capture} capture */
    function show(capture) {
      shown = capture;
      parts.hidden = false;
      clearTimeout(timer);
      for (const part of [head, strip, labels, keep]) part.show(capture);
      runs.show(capture, sample);
      if (capture.state === "sealed") downloads.show(capture, sample);
      downloads.element.hidden = capture.state !== "sealed";
      fields.hidden = strip.element.hidden;
      if (!atRest(capture)) timer = setTimeout(load, EVERY_MS);
    }

    async function load() {
      const mine = ++turn;
      const before = shown;
      try {
        const capture = await captureWithLedger(api, path);
        if (mine !== turn) return;
        if (shown !== before) return load(); // pinned or labelled meanwhile: this answer may be from before
        show(capture);
        if (!atRest(capture)) return;
        analyses.show(capture);
        sample = capture.runs.length ? await sampleOf(api, id) : null;
        if (mine === turn && shown) show(shown);
      } catch (problem) {
        if (mine === turn) refused(problem);
      }
    }

    /** @param {unknown} problem */
    function refused(problem) {
      if (statusOf(problem) === 0) timer = setTimeout(load, EVERY_MS); // the banner says that the daemon is away
      else if (statusOf(problem) === 404) fill(element, el("h1", {}, t("capture.title")), el("div", { class: "note is-warn" }, symbol("warn"), el("p", {}, t("capture.gone"))), el("p", {}, el("a", { class: "button", href: "#captures" }, symbol("back"), t("captures.title"))));
      else context.refused(problem);
    }

    element.append(head.element, parts);
    load();
    return {
      unmount() {
        turn = NaN;
        clearTimeout(timer);
        runs.unmount();
      },
    };
  },
};
