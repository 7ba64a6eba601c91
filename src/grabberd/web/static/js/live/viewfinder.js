// The picture with its buttons and numbers.
import { el, setText, symbol } from "../core/dom.js";
import { deviceOf } from "../core/store.js";
import { createPicture } from "./picture.js";

/** @import { Context } from "../core/context.js" */
/** @import { Live } from "types/documents" */

/** @param {Context} context @param {{buttons: boolean}} options */
export function createViewfinder(context, { buttons }) {
  const { t, store, format } = context;
  const counts = el("p", { class: "viewfinder-counts number" });
  const picture = createPicture(context);
  const bar = buttons && el("div", { class: "row viewfinder-bar" },
    toggle(t("live.freeze"), "freeze", "pause", (on) => picture.freeze(on)),
    toggle(t("live.ids"), "ids", null, (on) => picture.choose("ids", on)),
    toggle(t("live.residuals"), "residuals", null, (on) => {
      picture.choose("residuals", on);
      legend.hidden = !on;
    }),
  );
  const legend = el("p", { class: "legend small", hidden: true },
    el("span", { class: "legend-good" }, t("live.residual.good")), el("span", { class: "legend-fair" }, t("live.residual.fair")), el("span", { class: "legend-poor" }, t("live.residual.poor")));
  const element = el("section", { class: "card viewfinder", "aria-labelledby": "viewfinder-title" },
    el("div", { class: "row between" }, el("h2", { id: "viewfinder-title" }, t("live.picture")), counts), picture.element, legend, bar);

  const end = store.subscribe((known) => deviceOf(known)?.live, (live) => setText(counts, countsOf(live)));

  /** @param {Live | null | undefined} live */
  function countsOf(live) {
    if (!live) return t("live.notMeasured");
    const { left, right } = live.views ?? {};
    const parts = left === undefined ? [context.tn("live.blobs", live.blobs)] : [t("live.perView", { left, right })];
    if (live.residual_px !== null) parts.push(t("live.residual.mean", { px: format.number(live.residual_px, 2) }));
    return parts.join(" · ");
  }

  return {
    element,
    unmount() {
      end();
      picture.unmount();
    },
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
