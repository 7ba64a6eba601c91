// The captures that are compared: taken out one by one, added from all there are.
import { createChooser } from "../captures/chooser.js";
import { lineOf } from "../captures/words.js";
import { el, fill, symbol } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture } from "types/documents" */

/** @param {Context} context @param {string[]} ids chosen @param {(ids: string[]) => void} changed */
export function createChoice(context, ids, changed) {
  const { t } = context;
  const list = el("ul", { class: "compare-chosen", "aria-label": t("compare.chosen") });
  const chooser = createChooser(context, { label: t("compare.add"), choose: (id) => void (id && changed([...ids, id])) });
  return {
    element: el("section", { class: "card stack" }, list, chooser.element),
    /** @param {(Capture | {id: string, gone: true})[]} captures */
    show(captures) {
      fill(list, captures.map((one) => {
        const name = "gone" in one ? t("compare.gone", { id: one.id }) : lineOf(context, one);
        return el("li", {}, el("span", {}, name), el("button", { class: "button icon plain", type: "button", "aria-label": t("compare.remove", { name }), data: { remove: one.id }, on: { click: () => changed(ids.filter((id) => id !== one.id)) } }, symbol("close")));
      }));
    },
  };
}
