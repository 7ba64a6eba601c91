// The captures that are chosen in the list.

/** @import { Capture } from "types/documents" */
/** @typedef {ReturnType<typeof createSelection>} Selection */

/** @param {() => void} changed */
export function createSelection(changed) {
  /** @type {Map<string, Capture>} */
  const chosen = new Map();

  return {
    /** @param {string} id */
    has: (id) => chosen.has(id),
    /** In the order in which they were chosen. */
    all: () => [...chosen.values()],
    size: () => chosen.size,
    /** @param {Capture} capture @param {boolean} on */
    set(capture, on) {
      if (on) chosen.set(capture.id, capture);
      else chosen.delete(capture.id);
      changed();
    },
    /** @param {Capture[]} captures */
    add(captures) {
      for (const one of captures) chosen.set(one.id, one);
      changed();
    },
    /** What is known of it now, if it is chosen. @param {Capture} capture */
    update(capture) {
      if (chosen.has(capture.id)) chosen.set(capture.id, capture);
    },
    /** @param {string[]} ids */
    remove(ids) {
      for (const id of ids) chosen.delete(id);
      changed();
    },
    clear() {
      chosen.clear();
      changed();
    },
  };
}
