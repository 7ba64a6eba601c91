// The captures there are.
import { createList } from "../captures/list.js";
import { createSearch } from "../captures/search.js";
import { el, symbol } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */

export const panel = {
  title: "captures.title",

  /** @param {HTMLElement} element @param {Context} context */
  mount(element, context) {
    const search = createSearch(context, () => list.search());
    const list = createList(context, search);
    const compare = el("a", { class: "button", href: "#compare" }, symbol("compare"), context.t("captures.compare"));
    const profiles = el("a", { class: "button", href: "#profiles" }, context.t("profiles.title"));
    element.append(el("div", { class: "row between" }, el("h1", {}, context.t("captures.title")), el("div", { class: "row" }, profiles, compare)), search.element, list.element);
    return { unmount: list.unmount };
  },
};
