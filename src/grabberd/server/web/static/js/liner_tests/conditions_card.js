// The conditions of a test as they are at this moment.
import { el, fill, symbol } from "../core/dom.js";
import { deviceOf } from "../core/store.js";
import { followCurves } from "../live/curves_feed.js";
import { conditionsOf } from "./conditions.js";

/** @import { Context } from "../core/context.js" */
/** @import { Recipe } from "types/documents" */
/** @import { Sample } from "../live/curves_message.js" */
/** @import { Condition } from "./conditions.js" */

const LOOK_S = 2;
const EVERY_MS = 500;
const SIGNS = { good: "ok", warn: "warn", bad: "bad", idle: "info" };
const DIGITS = 1;

/** @param {Context} context @param {Recipe} recipe */
export function createConditions(context, recipe) {
  const { t, store, api, format } = context;
  const list = el("ul", { class: "tests-conditions" });
  const element = el("section", { class: "card stack", "aria-labelledby": "tests-now" }, el("h2", { id: "tests-now" }, t("tests.now.title")), list);
  let targets = 0;
  let asked = "";
  let shown = "";
  /** @type {Sample[]} */
  let samples = [];
  const feed = followCurves(context, LOOK_S, ({ fields, now_s }) => (samples = fields.filter((one) => one.time_s >= now_s - LOOK_S)));

  function show() {
    const known = store.get();
    const device = known.connection.online ? deviceOf(known) : null;
    if (device && device.name !== asked) ask(device.name);
    const found = conditionsOf(device, known.state?.loggers ?? {}, device ? samples : [], targets, recipe);
    const said = found.map((one) => [one, wordsOf(one)]);
    const text = JSON.stringify(said);
    if (text === shown) return;
    shown = text;
    fill(list, ...found.map((one) => el("li", { class: `tests-condition is-${one.level}`, data: { condition: one.name, level: one.level } }, symbol(SIGNS[one.level]), el("span", {}, wordsOf(one)))));
  }

  /** @param {Condition} condition */
  function wordsOf({ name, word, values }) {
    const chamber = name === "pulsation" || name === "liner" ? { chamber: t(`tests.now.chamber.${name}`) } : {};
    const numbers = Object.fromEntries(Object.entries(values).map(([key, value]) => [key, format.number(value, Number.isInteger(value) ? 0 : DIGITS)]));
    return t(`tests.now.${"chamber" in chamber ? "vacuum" : name}.${word}`, { ...numbers, ...chamber });
  }

  /** How many targets there should be. @param {string} device */
  async function ask(device) {
    asked = device;
    const object = await api.get(`/devices/${encodeURIComponent(device)}/object`).catch(() => null);
    targets = object?.target.length ?? 0;
  }

  const timer = setInterval(show, EVERY_MS);
  show();
  return {
    element,
    unmount() {
      clearInterval(timer);
      feed.end();
    },
  };
}
