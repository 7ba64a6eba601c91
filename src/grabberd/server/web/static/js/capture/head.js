// Head of a capture: its name, its outcome, and links to its views.
import { badge, channelsBadge, endIn, findingIn, labelsIn, ledgerIn, lengthIn, measuredBadge, totalOf } from "../captures/words.js";
import { el, fill, symbol } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture } from "types/documents" */

const WAYS = [["replay", "play"], ["analysis", "maps"], ["compare", "compare"]];
/** @typedef {"stop" | "trigger"} Action */
/** @type {Partial<Record<Capture["state"], Action[]>>} */
const ACTIONS = { recording: ["stop"], armed: ["trigger", "stop"] };
/** What needs no points, and no end of the capture. */
const OF_ALL = new Set(["replay"]);

/** @param {Context} context */
export function createHead(context) {
  const { t, tn, format, api } = context;
  const title = el("h1");
  const said = el("div", { class: "capture-head-said" });
  const facts = el("dl", { class: "facts" });
  const ways = el("nav", { class: "row", "aria-label": t("capture.ways") });
  const live = el("div", { class: "row" });
  const back = el("a", { class: "button plain", href: "#captures" }, symbol("back"), t("captures.title"));
  const element = el("div", { class: "stack" }, el("div", {}, back, title), el("section", { class: "card stack capture-head" }, said, live, ways, facts));
  let busy = false;

  /** @param {Capture} capture */
  function show(capture) {
    const labels = labelsIn(context, capture);
    fill(title, format.moment(capture.created_utc), labels && ` · ${labels}`);
    const words = capture.state === "armed" || capture.ledger.complete ? null : el("strong", { class: "capture-ledger" }, ledgerIn(context, capture));
    fill(said, badge(context, capture), words, measuredBadge(context, capture.coverage), capture.coverage && el("span", { class: "capture-measured" }, findingIn(context, capture.coverage.findings[0])), channelsBadge(context, capture.channels), capture.channels?.verdict === "with gaps" && el("span", { class: "capture-measured" }, capture.channels.in_words), capture.pinned && el("span", { class: "badge is-idle" }, symbol("pin"), t("captures.pinned")));
    const open = WAYS.filter(([way]) => (OF_ALL.has(way) ? totalOf(capture) > 0 : capture.state === "sealed" && capture.runs.length > 0));
    fill(ways, open.map(([way, sign]) => wayTo(way, sign, capture)));
    ways.hidden = !open.length;
    showLive(capture);
    showFacts(capture);
  }

  /** @param {string} way @param {string} sign @param {Capture} capture */
  function wayTo(way, sign, capture) {
    return el("a", { class: `button ${way === "replay" ? "primary" : ""}`, href: `#${way}/${encodeURIComponent(capture.id)}` }, symbol(sign), t(`capture.way.${way}`));
  }

  /** Stop, or start and cancel of an armed one: the buttons stay the same as long as the state does. @param {Capture} capture */
  function showLive(capture) {
    const actions = (context.may("operator") && ACTIONS[capture.state]) || [];
    const names = actions.map((action) => (capture.state === "armed" && action === "stop" ? "disarm" : action));
    live.hidden = !actions.length;
    if (live.dataset.shown === names.join()) return;
    live.dataset.shown = names.join();
    fill(live, ...actions.map((action, i) => button(capture.id, action, names[i])));
  }

  /** @param {string} id @param {Action} action @param {string} name */
  function button(id, action, name) {
    const kind = { stop: "danger", trigger: "good", disarm: "" }[name];
    return el("button", { class: `button ${kind}`, type: "button", data: { do: name }, on: { click: () => act(id, action) } }, name !== "disarm" && symbol(name), t(`operate.${name}`));
  }

  /** @param {string} id @param {Action} action */
  async function act(id, action) {
    if (busy) return;
    busy = true;
    await api.post(`/captures/${encodeURIComponent(id)}/${action}`).catch(context.refused);
    busy = false;
  }

  /** @param {Capture} capture */
  function showFacts(capture) {
    const before = capture.pre_trigger_fields ? tn("captures.fields", capture.pre_trigger_fields) : null;
    const grey = capture.bits ? t(capture.bits === 1 ? "capture.grey.one" : "capture.grey.some", { bits: capture.bits, levels: 2 ** capture.bits }) : null;
    const all = {
      length: lengthIn(context, capture), before, ended: capture.state === "armed" || capture.state === "recording" ? null : endIn(context, capture.ended_because),
      grabber: capture.device, grey, id: capture.id,
    };
    fill(facts, ...Object.entries(all).filter(([, text]) => text).map(([name, text]) => [el("dt", {}, t(`capture.fact.${name}`)), el("dd", {}, text)]));
  }
  return { element, show };
}
