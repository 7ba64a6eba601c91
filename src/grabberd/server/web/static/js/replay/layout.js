// The panes of a replay: four side by side on a desk, one at a time on a phone; all of it on the full screen.
import { el, fill, symbol } from "../core/dom.js";
import { keep, keptText } from "../core/kept.js";

/** @import { Context } from "../core/context.js" */

export const PANES = /** @type {const} */ (["picture", "wall", "curves", "map"]);
const KEPT = "replay.pane";

/** @typedef {(typeof PANES)[number]} Pane */

/** @param {Context} context @param {(pane: Pane) => void} seen told of the pane that a phone shows */
export function createLayout(context, seen) {
  const { t } = context;
  const first = PANES.find((one) => one === keptText(KEPT)) ?? "picture";
  const radios = PANES.map((name) => el("label", {}, el("input", { type: "radio", name: "replay-pane", checked: name === first, on: { change: () => choose(name) } }), t(`replay.pane.${name}`)));
  const pick = el("div", { class: "choices replay-switch", role: "radiogroup", "aria-label": t("replay.panes") }, radios);
  const places = Object.fromEntries(PANES.map((name) => [name, el("section", { class: "card replay-pane", "aria-label": t(`replay.pane.${name}`), data: { pane: name } })]));
  const panes = el("div", { class: "replay-panes", data: { shown: first } }, Object.values(places));
  const full = el("button", { class: "button", type: "button", "aria-pressed": "false", data: { do: "full" }, hidden: !document.fullscreenEnabled, on: { click: turn } }, symbol("shape"), t("replay.full"));
  const element = el("div", { class: "replay" }, pick, panes);

  /** @param {Pane} name */
  function choose(name) {
    panes.dataset.shown = name;
    keep(KEPT, name);
    seen(name);
  }

  function turn() {
    if (document.fullscreenElement) document.exitFullscreen();
    else element.requestFullscreen().catch(() => context.announce(t("replay.notFull")));
  }

  const told = () => full.setAttribute("aria-pressed", String(document.fullscreenElement === element));
  document.addEventListener("fullscreenchange", told);

  return {
    element, full,
    /** @param {Record<Pane, HTMLElement>} bodies */
    put(bodies) {
      for (const name of PANES) fill(places[name], el("h2", {}, t(`replay.pane.${name}`)), bodies[name]);
    },
    /** Panes that are seen. */
    seen: () => PANES.filter((name) => places[name].offsetWidth > 0),
    end: () => document.removeEventListener("fullscreenchange", told),
  };
}
