// Alerts right below Start: a line for each problem, which leads to its light.
import { el, fill, symbol } from "../core/dom.js";
import { wordsOf } from "./words.js";

/** @import { Context } from "../core/context.js" */
/** @import { Light } from "./judge.js" */

const MOST = 3;

/** @param {Context} context @param {(id: string) => void} open opens a light */
export function createAlerts(context, open) {
  const element = el("div", { class: "alerts" });
  let shown = "";

  /** @param {Light[]} lights */
  function show(lights) {
    const bad = lights.filter((light) => light.level === "bad").slice(0, MOST);
    const lines = bad.map((light) => `${context.t(`lights.${light.id}.title`)}: ${wordsOf(context, light)}`);
    if (lines.join() === shown) return;
    shown = lines.join();
    fill(element, bad.map((light, i) => alert(lines[i], () => open(light.id))));
  }

  return { element, show };
}

/** @param {string} line @param {() => void} press */
function alert(line, press) {
  return el("button", { class: "alert is-bad", type: "button", on: { click: press } }, symbol("bad"), el("span", { class: "grow" }, line), symbol("down"));
}
