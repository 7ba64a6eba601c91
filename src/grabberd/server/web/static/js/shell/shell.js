// The frame: what is round every panel.
import { el } from "../core/dom.js";
import { ENTRIES } from "../panels/index.js";
import { createBanner } from "./banner.js";
import { createMenu } from "./menu.js";
import { createNavigation } from "./navigation.js";
import { createSignIn } from "./sign_in.js";
import { createStage } from "./stage.js";

/** @import { Context } from "../core/context.js" */

/** @param {Context} context */
export function createShell(context) {
  const { t, store } = context;
  const main = el("main", { id: "main", class: "stage", tabindex: "-1" });
  const skip = el("button", { class: "skip button", type: "button", on: { click: () => main.focus() } }, t("core.skip"));
  const navigation = createNavigation(context, ENTRIES);
  const brand = el("p", { class: "brand" }, "grabberd");
  const header = el("header", { class: "top" }, brand, navigation.element, createMenu(context));
  const stage = createStage(context, ENTRIES, main, navigation.mark);
  store.subscribe(
    (known) => known.session !== null,
    (isKnown) => {
      navigation.element.hidden = !isKnown;
      if (isKnown) stage.start();
      else stage.show(createSignIn(context));
    },
  );
  return el("div", { class: "shell" }, skip, header, createBanner(context), main, context.toasts);
}
