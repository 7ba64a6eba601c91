// The way from panel to panel: on top on a tablet, at the bottom on a phone.
import { el, symbol } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { Entry } from "../panels/index.js" */

/** @param {Context} context @param {Entry[]} entries */
export function createNavigation(context, entries) {
  const { t } = context;
  const links = entries.flatMap(({ id, nav, route }) =>
    nav ? [el("a", { href: `#${route}`, class: "nav-link", data: { entry: id } }, symbol(nav), el("span", {}, t(`core.nav.${id}`)))] : [],
  );
  const element = el("nav", { class: "nav", "aria-label": t("core.navigation") }, links);

  /** @param {string} id */
  function mark(id) {
    for (const link of links) {
      if (link.dataset.entry === id) link.setAttribute("aria-current", "page");
      else link.removeAttribute("aria-current");
    }
  }

  return { element, mark };
}
