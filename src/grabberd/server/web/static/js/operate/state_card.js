// The state: one word, its colour, its symbol, and since when.
import { el, setSymbol, setText, symbol } from "../core/dom.js";
import { wordsOf } from "../lights/words.js";
import { situationOf } from "./situation.js";

/** @import { Context } from "../core/context.js" */
/** @import { Situation } from "./situation.js" */

/** @param {Context} context */
export function createStateCard(context) {
  const { t, format, store, now_ms, may } = context;
  const picture = symbol("unknown");
  const word = el("span", { class: "state-word" });
  const since = el("p", { class: "state-since" });
  const name = el("p", { class: "state-device" });
  const reason = el("p", { class: "state-reason" });
  const spoken = el("p", { class: "visually-hidden", "aria-live": "polite" });
  const card = el("section", { class: "state", "aria-labelledby": "state-word" }, picture,
    el("div", { class: "state-words" }, name, el("h1", { id: "state-word" }, word), reason, since), spoken);

  function show() {
    const situation = situationOf(store.get(), may("operator"));
    const words = t(`operate.state.${situation.word}`);
    card.className = `state is-${situation.level}`;
    card.dataset.state = situation.word;
    setSymbol(picture, situation.symbol);
    setText(word, words);
    const why = situation.worst ? `${t(`lights.${situation.worst.id}.title`)}: ${wordsOf(context, situation.worst)}` : "";
    setText(reason, why);
    reason.hidden = why === "";
    setText(spoken, words);
    setText(name, context.device()?.name ?? "");
    setText(since, sinceWords(situation.since));
  }

  /** @param {Situation["since"]} time */
  function sinceWords(time) {
    if (time === null) return "";
    const moment = typeof time === "number" ? time : Date.parse(time);
    return t("operate.since", { time: format.time(moment), duration: format.duration((now_ms() - moment) / 1000) });
  }

  const stop = store.subscribe((known) => known, show);
  const ticking = setInterval(show, 1000);
  return {
    element: card,
    unmount() {
      stop();
      clearInterval(ticking);
    },
  };
}
