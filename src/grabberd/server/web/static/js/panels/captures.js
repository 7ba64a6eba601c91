// The captures there are.
import { createFacets } from "../captures/facets.js";
import { createList } from "../captures/list.js";
import { createQuestion } from "../captures/question.js";
import { createSearch } from "../captures/search.js";
import { createSelection } from "../captures/selection.js";
import { createSelectionBar } from "../captures/selection_bar.js";
import { el, symbol } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */

export const panel = {
  title: "captures.title",

  /** @param {HTMLElement} element @param {Context} context */
  mount(element, context) {
    const { t } = context;
    const question = createQuestion(() => {
      search.show();
      facets.show();
      list.search();
    });
    const selection = createSelection(() => {
      list.mark();
      bar.show();
    });
    const search = createSearch(context, question);
    const facets = createFacets(context, question);
    const list = createList(context, question, selection, { counted: facets.show, search: search.focus });
    const bar = createSelectionBar(context, selection, list);
    const compare = el("a", { class: "button", href: "#compare" }, symbol("compare"), t("captures.compare"));
    const profiles = el("a", { class: "button", href: "#profiles" }, t("profiles.title"));
    element.append(
      el("div", { class: "row between" }, el("h1", {}, t("captures.title")), el("div", { class: "row" }, profiles, compare)),
      search.element,
      el("div", { class: "captures-two" }, facets.element, el("div", { class: "stack" }, bar.report, list.element)),
      bar.element,
    );
    return {
      unmount() {
        search.unmount();
        facets.unmount();
        list.unmount();
      },
    };
  },
};
