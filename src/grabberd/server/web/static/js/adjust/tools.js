// What can be done with the live picture: hold it, see more in it, look closer.
import { el, setText, symbol } from "../core/dom.js";
import { createZoom } from "./zoom.js";

/** @import { Context } from "../core/context.js" */
/** @import { Preview } from "../live/message.js" */
/** @import { Choice, Picture } from "../live/picture.js" */

const SAID_EVERY_MS = 500;

/** @param {Context} context @param {Picture} picture */
export function createTools(context, picture) {
  const { t, tn } = context;
  const zoom = createZoom(context, picture);
  const residuals = el("p", { class: "legend small", hidden: true },
    el("span", { class: "legend-good" }, t("live.residual.good")), el("span", { class: "legend-fair" }, t("live.residual.fair")), el("span", { class: "legend-poor" }, t("live.residual.poor")));
  const white = el("span", { class: "legend-white" });
  const black = el("span", { class: "legend-black" });
  const clipped = el("p", { class: "legend small number", hidden: true }, white, black);
  let said_ms = -Infinity;

  /** @param {Choice} name @param {HTMLElement} [legend] shown with it */
  const choice = (name, legend) => toggle(t(`live.${name}`), name, null, (on) => {
    picture.choose(name, on);
    if (legend) legend.hidden = !on;
    if (name === "bits") exposure.disabled = on;
  });
  const exposure = choice("clipped", clipped);
  const bar = el("div", { class: "row viewfinder-bar" },
    toggle(t("live.freeze"), "freeze", "pause", picture.freeze), choice("ids"), choice("residuals", residuals), exposure, choice("bits"));

  return {
    element: el("div", { class: "stack" }, el("div", { class: "row between" }, bar, zoom.element), residuals, clipped),
    /** @param {Preview} preview */
    seen(preview) {
      if (clipped.hidden || performance.now() - said_ms < SAID_EVERY_MS) return;
      said_ms = performance.now();
      setText(white, tn("live.white", preview.white));
      setText(black, tn("live.black", preview.black));
    },
    unmount: zoom.unmount,
  };
}

/** @param {string} words @param {string} name @param {string | null} sign @param {(on: boolean) => void} pressed */
function toggle(words, name, sign, pressed) {
  const button = el("button", { class: "button", type: "button", "aria-pressed": "false", data: { toggle: name } }, sign && symbol(sign), words);
  button.addEventListener("click", () => {
    const on = button.getAttribute("aria-pressed") !== "true";
    button.setAttribute("aria-pressed", String(on));
    pressed(on);
  });
  return button;
}
