// Any number of captures compared: their quantities, which of them differ, their mean cycles.
import { createChoice } from "../compare/choice.js";
import { createCycles } from "../compare/cycles.js";
import { groupings, usualGrouping } from "../compare/grouping.js";
import { createQuantities } from "../compare/quantities.js";
import { createVerdicts } from "../compare/verdicts.js";
import { newKey, statusOf } from "../core/api.js";
import { lineOf } from "../captures/words.js";
import { el, fill, symbol } from "../core/dom.js";

/** @import { Known } from "../core/store.js" */
/** @import { PanelContext } from "./index.js" */
/** @import { Capture, Study } from "types/documents" */

const MOST = 100;
/** Why the daemon leaves a capture out that only has to be analysed. */
const NOT_ANALYSED = "it has not been analysed";

export const panel = {
  title: "compare.title",

  /** @param {HTMLElement} element @param {PanelContext} context */
  mount(element, context) {
    const { t, tn, api, go, parameters, store } = context;
    const ids = [...new Set((parameters.ids ?? "").split(",").filter(Boolean))].slice(0, MOST);
    const choice = createChoice(context, ids, (chosen) => go("compare", ...(chosen.length ? [chosen.join()] : [])));
    const tools = el("div", { class: "compare-tools", hidden: true });
    const body = el("div", { class: "stack" });
    const back = el("a", { class: "button plain", href: "#captures" }, symbol("back"), t("captures.title"));
    /** @type {ReturnType<typeof createCycles> | null} */
    let cycles = null;
    let turn = 0;
    let again = () => {};

    async function open() {
      if (!ids.length) return fill(body, el("p", { class: "muted" }, t("compare.choose")));
      wait();
      const found = await Promise.all(ids.map((id) => api.get(`/captures/${encodeURIComponent(id)}`).catch((problem) => {
        if (statusOf(problem) === 404) return { id, gone: /** @type {const} */ (true) };
        throw problem;
      })));
      if (turn < 0) return;
      choice.show(found);
      const captures = found.flatMap((one) => ("gone" in one ? [] : [one]));
      if (!captures.length) return fill(body, "");
      offerGroups(captures);
      await study(captures, usualGrouping(captures), "");
    }

    function wait() {
      fill(body, el("div", { class: "card awaited", role: "status", "aria-label": t("compare.loading") }, el("span"), el("span"), el("span")));
    }

    /** @param {Capture[]} captures */
    function offerGroups(captures) {
      const by = el("select", { class: "input", id: "compare-by", on: { change: () => change() } }, groupings(captures).map((name) => el("option", { value: name, selected: name === usualGrouping(captures) }, groupIn(name))));
      const cows = new Set(captures.map(({ labels }) => labels.cow).filter(Boolean));
      const within = el("input", { type: "checkbox", id: "compare-within", on: { change: () => change() } });
      again = () => study(captures, by.value, within.checked && by.value !== "cow" ? "cow" : "").catch(refused);
      const change = () => {
        wait();
        again();
      };
      fill(tools, el("div", { class: "field" }, el("label", { class: "field-label", for: "compare-by" }, t("compare.by.title")), by), cows.size > 1 && el("label", { class: "check" }, within, t("compare.within")));
      tools.hidden = captures.length < 2;
    }

    /** @param {string} name of a label, or of what else makes groups */
    function groupIn(name) {
      const { texts } = context;
      if (texts.has(`compare.by.${name || "none"}`)) return t(`compare.by.${name || "none"}`);
      return texts.has(`operate.labels.${name}`) ? t(`operate.labels.${name}`) : name;
    }

    /** @param {Capture[]} captures @param {string} by @param {string} within */
    async function study(captures, by, within) {
      const mine = ++turn;
      const query = new URLSearchParams(captures.map(({ id }) => ["captures", id]));
      if (by) query.set("by", by);
      if (within) query.set("within", within);
      const found = await api.get(`/study?${query}`);
      if (mine === turn) show(captures, found, by);
    }

    /** @param {Capture[]} captures @param {Study} found @param {string} by what makes the groups */
    function show(captures, found, by) {
      const named = new Map(captures.map((one) => [one.id, one]));
      const groupName = (/** @type {string} */ group) => {
        const capture = named.get(group);
        if (capture) return lineOf(context, capture);
        return by && by !== "date" ? `${groupIn(by)} ${group}` : group;
      };
      const columns = found.tables.captures.columns;
      const values = (/** @type {string} */ name) => columns.find((one) => one.name === name)?.values ?? [];
      const analysed = values("capture").flatMap((id, i) => {
        const capture = named.get(String(id));
        return capture ? [{ capture, analysis: String(values("analysis")[i]) }] : [];
      });
      cycles?.end();
      cycles = analysed.length ? createCycles(context, analysed) : null;
      const waiting = found.left_out.filter(({ reason }) => reason === NOT_ANALYSED).flatMap(({ capture }) => named.get(capture) ?? []).filter(({ analysis }) => !analysis || analysis.state === "cancelled");
      fill(body, offerAnalyses(waiting), captures.length > 1 && createVerdicts(context, found, groupName), createQuantities(context, found, captures), cycles?.element);
    }

    /** @param {Capture[]} waiting those without an analysis */
    function offerAnalyses(waiting) {
      if (!waiting.length || !context.may("operator")) return null;
      const button = el("button", { class: "button primary", type: "button", data: { do: "analyse" }, on: { click: queue } }, symbol("maps"), tn("compare.analyse", waiting.length));
      async function queue() {
        button.disabled = true;
        const asked = await Promise.all(waiting.map(({ id }) => api.post(`/captures/${encodeURIComponent(id)}/analysis`, { body: { profiles: true, configured: true, inputs: {}, bursts: [] }, key: newKey() }).catch(context.refused)));
        const count = asked.filter(Boolean).length;
        if (count) context.announce(tn("compare.queued", count));
        else button.disabled = false;
      }
      return el("div", {}, button);
    }

    /** @param {unknown} problem */
    function refused(problem) {
      fill(body, el("button", { class: "button", type: "button", on: { click: () => location.reload() } }, t("core.reload")));
      context.refused(problem);
    }

    element.append(el("div", {}, back, el("h1", {}, t("compare.title"))), choice.element, tools, body);
    open().catch(refused);
    // What has been analysed meanwhile appears by itself.
    const before = endedOf(store.get());
    const end = store.subscribe(endedOf, (now) => void (now !== before && again()));
    return {
      unmount() {
        turn = -Infinity;
        end();
        cycles?.end();
      },
    };
  },
};

/** Which analyses ended last, as far as the state tells. @param {Known} known */
function endedOf(known) {
  return Object.values(known.state?.devices ?? {}).map(({ latest_analysis: one }) => `${one?.capture} ${one?.state} ${one?.created_utc}`).join();
}
