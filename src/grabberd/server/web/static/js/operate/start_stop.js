// Start and Stop. Start requests one capture however often it is pressed; Stop is always there.
import { newKey, statusOf } from "../core/api.js";
import { el, fill, setText, symbol } from "../core/dom.js";
import { wordsOf } from "../lights/words.js";
import { situationOf } from "./situation.js";

/** @import { Context } from "../core/context.js" */
/** @import { Situation } from "./situation.js" */

/**
 * @param {Context} context
 * @param {{submit: (key: string) => Promise<unknown>, isSound: () => boolean, waits: () => boolean, isRequested: () => boolean, isOver: () => boolean, next: () => Promise<void>}} form
 */
export function createStartStop(context, form) {
  const { t, store, may } = context;
  const why = el("p", { class: "start-why", id: "start-why" });
  const buttons = el("div", { class: "start-buttons" });
  const element = el("section", { class: "start", "aria-label": t("operate.title") }, buttons, why);
  let key = newKey();
  let busy = "";
  let shown = "";

  const start = el("button", { class: "button good large grow", type: "button", data: { do: "start" }, "aria-describedby": "start-why", on: { click: submit } });
  const next = el("button", { class: "button primary large grow", type: "button", data: { do: "next" }, on: { click: () => form.next() } }, symbol("next"), t("operate.next"));
  const again = el("button", { class: "button", type: "button", data: { do: "again" }, on: { click: submit } });
  const trigger = el("button", { class: "button good large grow", type: "button", data: { do: "trigger" }, on: { click: () => act("trigger") } }, symbol("trigger"), t("operate.trigger"));
  const disarm = el("button", { class: "button large", type: "button", data: { do: "disarm" }, on: { click: () => act("stop") } }, t("operate.disarm"));
  const stopWords = el("span");
  const stop = el("button", { class: "button danger large grow", type: "button", data: { do: "stop" }, on: { click: () => act("stop") } }, symbol("stop"), stopWords);

  /** Requests a capture; with the same key until an answer has come, so that one lost on the way starts no second capture. */
  async function submit() {
    if (busy) return;
    setBusy("start");
    try {
      const waits = form.waits();
      await form.submit(key);
      key = newKey();
      context.announce(t(waits ? "operate.armedNow" : "operate.started"), { kind: "good" });
    } catch (problem) {
      if (statusOf(problem)) key = newKey();
      context.refused(problem);
    }
    endBusy("start");
  }

  /** Captures of a group are triggered and stopped together. @param {"stop" | "trigger"} what */
  async function act(what) {
    const { running, armed, group } = situationOf(store.get(), may("operator"));
    const id = running ?? armed;
    // The events may show the capture armed before the answer to its request has come.
    if (!id || (what === "trigger" && busy === what)) return;
    setBusy(what);
    try {
      await (group ? context.api.post(`/capture-groups/${group}/${what}`) : context.api.post(`/captures/${id}/${what}`));
      if (what === "stop") context.announce(t("operate.stopped"), { kind: "good" });
    } catch (problem) {
      context.refused(problem);
    }
    endBusy(what);
  }

  /** @param {string} what */
  function setBusy(what) {
    busy = what;
    show();
  }

  /** @param {string} what a request that has been answered; a later one may be under way */
  function endBusy(what) {
    if (busy === what) setBusy("");
  }

  function show() {
    const situation = situationOf(store.get(), may("operator"));
    const reason = situation.why ?? (form.isSound() ? null : "form");
    const wanted = situation.running ? "running" : situation.armed ? "armed" : form.isOver() && !form.isRequested() ? "over" : "idle";
    if (wanted !== shown) {
      fill(buttons, { running: [stop], armed: [trigger, disarm], over: [next, again], idle: [start] }[wanted]);
      shown = wanted;
    }
    const name = form.waits() ? "operate.arm" : situation.doubtful ? "operate.startAnyway" : "operate.start";
    fill(start, symbol(form.waits() ? "armed" : "start"), t(busy === "start" ? "operate.starting" : name));
    fill(again, t(busy === "start" ? "operate.starting" : "operate.again"));
    again.disabled = reason !== null || busy === "start";
    setText(stopWords, t(busy === "stop" ? "operate.stopping" : "operate.stop"));
    start.disabled = reason !== null || busy === "start" || form.isRequested();
    buttons.hidden = !may("operator");
    setText(why, whyWords(wanted, reason, situation));
    why.hidden = why.textContent === "";
  }

  /** @param {string} wanted @param {string | null} reason @param {Situation} situation */
  function whyWords(wanted, reason, { doubtful, worst }) {
    const isIdle = wanted === "idle" || wanted === "over";
    if (reason !== null && (isIdle || reason === "viewer")) return t(`operate.why.${reason}`);
    if (!doubtful || !worst || !isIdle) return "";
    return t("operate.doubtful", { reason: `${t(`lights.${worst.id}.title`)}: ${wordsOf(context, worst)}` });
  }

  const end = store.subscribe((known) => known, show);
  return { element, show, unmount: end };
}
