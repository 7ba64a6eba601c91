// A part of the list: its rows are in the document while it is near the screen, and else only its height.
import { el, fill } from "../core/dom.js";
import { createRow } from "./row.js";

/** @import { Context } from "../core/context.js" */
/** @import { Selection } from "./selection.js" */
/** @import { Capture } from "types/documents" */
/** @typedef {ReturnType<typeof createBlock>} Block */

/** @param {Context} context @param {Selection} selection @param {Capture[]} captures */
export function createBlock(context, selection, captures) {
  const element = el("ul", { class: "capture-list", "aria-label": context.t("captures.title") });
  /** @type {Map<string, ReturnType<typeof createRow>>} */
  const rows = new Map();
  let isFilled = false;

  /** Makes the rows there are to be. */
  function write() {
    isFilled = true;
    const wanted = captures.map((one) => {
      const row = rows.get(one.id) ?? createRow(context, one, selection);
      rows.set(one.id, row);
      row.show(one);
      row.mark();
      return row.element;
    });
    for (const id of [...rows.keys()]) if (!captures.some((one) => one.id === id)) rows.delete(id);
    // The same rows in the same order are left where they are, and so is the focus.
    if (wanted.length !== element.children.length || wanted.some((one, i) => element.children[i] !== one)) fill(element, ...wanted);
    element.style.blockSize = "";
  }

  write();
  return {
    element,
    captures: () => captures,
    /** @param {Capture[]} now */
    show(now) {
      captures = now;
      for (const one of now) selection.update(one);
      if (isFilled) write();
    },
    /** Whether it is near the screen. @param {boolean} near */
    near(near) {
      if (near && !isFilled) write();
      if (near || !isFilled || element.contains(document.activeElement)) return;
      element.style.blockSize = `${element.offsetHeight}px`;
      isFilled = false;
      rows.clear();
      fill(element);
    },
    /** Shows what is chosen. */
    mark: () => rows.forEach((row) => row.mark()),
  };
}
