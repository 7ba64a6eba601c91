// The picture with its numbers.
import { el, setText } from "../core/dom.js";
import { deviceOf, streams } from "../core/store.js";
import { createPicture } from "./picture.js";

/** @import { Context } from "../core/context.js" */
/** @import { Told } from "./picture.js" */
/** @import { Live } from "types/documents" */

/** @param {Context} context @param {Told} [told] */
export function createViewfinder(context, told) {
  const { t, store, format } = context;
  const counts = el("p", { class: "viewfinder-counts number" });
  const why = el("p", { class: "note is-warn", hidden: true });
  const picture = createPicture(context, told);
  const element = el("section", { class: "card viewfinder", "aria-labelledby": "viewfinder-title" },
    el("div", { class: "row between" }, el("h2", { id: "viewfinder-title" }, t("live.picture")), counts), picture.element, why);

  const end = store.subscribe(deviceOf, (device) => {
    setText(counts, countsOf(device?.live));
    // Such as a calibration for pictures of another standard: the picture itself shows nothing wrong.
    const lack = device && streams(device) && !device.live ? device.lacks.at(0) : undefined;
    why.hidden = !lack;
    setText(why, lack ? `${lack.message} – ${lack.hint}` : "");
  });

  /** @param {Live | null | undefined} live */
  function countsOf(live) {
    if (!live) return t("live.notMeasured");
    const { left, right } = live.views ?? {};
    const parts = left === undefined ? [context.tn("live.blobs", live.blobs)] : [t("live.perView", { left, right })];
    if (live.residual_px !== null) parts.push(t("live.residual.mean", { px: format.number(live.residual_px, 2) }));
    return parts.join(" · ");
  }

  return {
    element, picture,
    unmount() {
      end();
      picture.unmount();
    },
  };
}
