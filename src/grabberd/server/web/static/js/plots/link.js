// What the charts of a panel share: one cursor, one range, one playhead.

/**
 * @typedef {object} Shared all of them along the charts' x
 * @property {number | null} cursor under the pointer
 * @property {[number, number] | null} range null: all there is
 * @property {number | null} mark the playhead
 */

/** @typedef {ReturnType<typeof createLink>} Link */

/** @type {Shared} */
const NOTHING = { cursor: null, range: null, mark: null };

export function createLink() {
  let shared = NOTHING;
  /** @type {Set<(now: Shared, before: Shared) => void>} */
  const watchers = new Set();
  return {
    get: () => shared,
    /** Changes what is given, and tells who watches. @param {Partial<Shared>} change */
    set(change) {
      const before = shared;
      shared = { ...shared, ...change };
      for (const watcher of [...watchers]) watcher(shared, before);
    },
    /** @param {(now: Shared, before: Shared) => void} watcher @returns {() => void} ends it */
    watch(watcher) {
      watchers.add(watcher);
      return () => {
        watchers.delete(watcher);
        // A panel that is opened anew shows all there is.
        if (!watchers.size) shared = NOTHING;
      };
    },
  };
}

/** @type {Map<string, Link>} */
const named = new Map();

/** The link of all charts with this name. @param {string} name one of the few that the source has */
export function linkOf(name) {
  const link = named.get(name) ?? createLink();
  named.set(name, link);
  return link;
}
