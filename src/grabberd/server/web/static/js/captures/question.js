// What is asked of the captures: words, facets, order. It stands in the address, so that back and reload keep it.

const ADDRESS = "#captures";
const USUAL = "-time";
/** The facets whose values go together; of any other one value is chosen at a time. */
const SEVERAL = new Set(["verdict", "calibration", "label"]);

/** @typedef {ReturnType<typeof createQuestion>} Question */

/** @param {() => void} changed */
export function createQuestion(changed) {
  let asked = new URLSearchParams(location.hash.split("?")[1] ?? "");

  /** @param {URLSearchParams} now */
  function set(now) {
    asked = now;
    const text = asked.toString();
    history.replaceState(history.state, "", text ? `${ADDRESS}?${text}` : ADDRESS);
    changed();
  }

  /** @param {string} name @param {string} value empty: nothing */
  function put(name, value) {
    const now = new URLSearchParams(asked);
    if (value && !(name === "sort" && value === USUAL)) now.set(name, value);
    else now.delete(name);
    set(now);
  }

  return {
    /** @param {string} name */
    get: (name) => asked.get(name) ?? (name === "sort" ? USUAL : ""),
    put,
    /** True if a value is chosen. @param {string} name @param {string} value */
    has: (name, value) => asked.getAll(name).includes(value),
    /** Every choice there is, but for words and order. @returns {[string, string][]} */
    choices: () => [...asked].filter(([name]) => name !== "search" && name !== "sort"),
    /** Chooses a value, or no longer. @param {string} name @param {string} value */
    toggle(name, value) {
      const values = asked.getAll(name);
      const others = SEVERAL.has(name) ? values.filter((one) => one !== value) : [];
      const now = new URLSearchParams(asked);
      now.delete(name);
      for (const one of values.includes(value) ? others : [...others, value]) now.append(name, one);
      set(now);
    },
    /** Forgets words and choices; the order stays. */
    clear: () => set(new URLSearchParams(asked.has("sort") ? { sort: asked.get("sort") ?? "" } : {})),
    isNarrow: () => [...asked.keys()].some((name) => name !== "sort"),
    /** The query's part of a request. */
    query() {
      const query = new URLSearchParams(asked);
      const day = query.get("day");
      query.delete("day");
      if (day) for (const [name, utc] of Object.entries(boundsOf(day))) query.set(name, utc);
      return query;
    },
  };
}

/** The time zone of this tablet, in which days begin. */
export const ZONE = Intl.DateTimeFormat().resolvedOptions().timeZone || "UTC";

/** From midnight to midnight, by this tablet's clock. @param {string} day "2026-03-01" */
function boundsOf(day) {
  const [year, month, date] = day.split("-").map(Number);
  const [since, until] = [new Date(year, month - 1, date), new Date(year, month - 1, date + 1)];
  return Number.isNaN(since.getTime()) ? {} : { since: since.toISOString(), until: until.toISOString() };
}
