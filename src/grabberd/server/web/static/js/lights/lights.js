// The lights with words: what is well, what is not, why that may be, and what to try.
import { el, fill, setSymbol, setText, symbol } from "../core/dom.js";
import { deviceOf } from "../core/store.js";
import { createAlerts } from "./alerts.js";
import { judge } from "./judge.js";
import { isKnown, wordsOf } from "./words.js";

/** @import { Context } from "../core/context.js" */
/** @import { Light } from "./judge.js" */

const SYMBOLS = { good: "ok", warn: "warn", bad: "bad", idle: "unknown" };
const EVERY_MS = 1000;

/** @param {Context} context */
export function createLights(context) {
  const { t, store } = context;
  /** @type {Map<string, ReturnType<typeof createLight>>} */
  const lights = new Map();
  const list = el("div", { class: "lights" });
  const element = el("section", { class: "card lights-card", "aria-labelledby": "lights-title" }, el("h2", { id: "lights-title" }, t("lights.title")), list);

  const alerts = createAlerts(context, (id) => lights.get(id)?.open());

  function show() {
    const judged = judge(store.get());
    alerts.show(judged);
    for (const light of judged) {
      const one = lights.get(light.id) ?? createLight(context, light.id);
      if (!lights.has(light.id)) list.append(one.element);
      lights.set(light.id, one);
      one.show(light);
    }
    for (const [id, one] of lights) one.element.hidden = !judged.some((light) => light.id === id);
  }

  const away = store.subscribe((known) => known.connection, show);
  const state = store.subscribe((known) => deviceOf(known)?.health.level, show);
  const ticking = setInterval(show, EVERY_MS);
  return {
    element,
    alerts: alerts.element,
    unmount() {
      away();
      state();
      clearInterval(ticking);
    },
  };
}

/** @param {Context} context @param {string} id */
function createLight(context, id) {
  const { t } = context;
  const sign = symbol("unknown");
  const word = el("span", { class: "light-word" });
  const help = el("div", { class: "light-help" });
  const title = el("span", { class: "light-title" }, t(`lights.${id}.title`));
  const element = el("details", { class: "light is-idle", data: { light: id } }, el("summary", {}, sign, title, word), help);
  let level = "";
  let shown = "";
  let began = Date.now();

  /** @param {Light} light */
  function show(light) {
    if (light.level !== level) {
      began = context.now_ms();
      level = light.level;
      element.className = `light is-${level}`;
      element.dataset.level = level;
      setSymbol(sign, SYMBOLS[light.level]);
    }
    setText(word, wordsOf(context, light));
    const about = JSON.stringify([light.word, light.code, light.said, light.since]);
    if (about === shown) return;
    shown = about;
    fill(help, helpOf(context, light, light.since ? Date.parse(light.since) : began));
  }

  function open() {
    element.open = true;
    element.scrollIntoView({ block: "center" });
    element.querySelector("summary")?.focus();
  }

  return { element, show, open };
}

/** @param {Context} context @param {Light} light @param {number} since */
function helpOf(context, light, since) {
  const { t, tl, format } = context;
  const about = el("p", {}, t(`lights.${light.id}.about`));
  const begun = el("p", { class: "light-since" }, t("lights.since", { time: format.time(since) }));
  if (isKnown(context, light.code)) return [about, begun, el("p", {}, t(`causes.${light.code}.what`)), advice(context, tl(`causes.${light.code}.why`), tl(`causes.${light.code}.try`))];
  const reasons = tl(`lights.${light.id}.causes.${light.word}.why`);
  if (reasons.length) return [about, begun, advice(context, reasons, tl(`lights.${light.id}.causes.${light.word}.try`))];
  if (light.said?.length) return [about, begun, el("p", {}, el("strong", {}, t("lights.said")), " ", light.said.join(" – "))];
  return [about];
}

/** @param {Context} context @param {string[]} reasons @param {string[]} attempts */
function advice({ t }, reasons, attempts) {
  const items = (/** @type {string[]} */ texts) => texts.map((one) => el("li", {}, one));
  return [el("h3", {}, t("lights.reasons")), el("ul", {}, items(reasons)), el("h3", {}, t("lights.try")), el("ol", {}, items(attempts))];
}
