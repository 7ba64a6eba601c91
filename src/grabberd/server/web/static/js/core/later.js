// A part whose modules are fetched after the panel is shown: what the panel is for comes first.
import { el } from "./dom.js";

/** @import { Context } from "./context.js" */
/** @typedef {{element: HTMLElement, unmount?: () => void}} Part */

/**
 * @param {Context} context
 * @param {HTMLElement} element in the part's place until it is there
 * @param {() => Promise<(context: Context) => Part>} load gives what makes the part
 * @returns {Part}
 */
export function createLater(context, element, load) {
  /** @type {Part | null} */
  let part = null;
  let ended = false;

  async function show() {
    try {
      const create = await load();
      if (ended) return;
      part = create(context);
      element.replaceWith(part.element);
    } catch (error) {
      console.error(error);
      // A browser remembers that a module could not be fetched: only a reload asks for it again.
      const again = el("button", { class: "button", type: "button", on: { click: () => location.reload() } }, context.t("core.reload"));
      element.hidden = false;
      element.replaceChildren(el("div", { class: "note is-bad", role: "status" }, el("p", { class: "grow" }, context.t("core.notLoaded")), again));
    }
  }

  show();
  return {
    element,
    unmount() {
      ended = true;
      part?.unmount?.();
    },
  };
}
