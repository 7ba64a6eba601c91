// Texts in the user's language: catalogues by name, keys by dots, {places} filled in.

/** @typedef {Record<string, string | number | null | undefined>} Values */
/** @typedef {string | string[] | {[key: string]: Catalogue}} Catalogue */
/** @typedef {ReturnType<typeof createTexts>} Texts */

/**
 * @param {Record<string, Catalogue>} catalogue the first view's catalogues of a language, by name
 * @param {string} language
 * @param {() => Promise<Record<string, Catalogue>>} fetchRest gets the others
 */
export function createTexts(catalogue, language, fetchRest) {
  /** @type {Promise<unknown> | null} */
  let rest = null;
  const plurals = new Intl.PluralRules(language);

  /** @param {string} key @returns {Catalogue | undefined} */
  const find = (key) => key.split(".").reduce(below, catalogue);

  /** A text; what has none shows its key, which a test forbids. @param {string} key @param {Values} [values] */
  function t(key, values = {}) {
    const text = find(key);
    return typeof text === "string" ? filled(text, values) : key;
  }

  /** A text in the number's form: key.one or key.other, with {n}. @param {string} key @param {number} n */
  function tn(key, n, /** @type {Values} */ values = {}) {
    const shown = new Intl.NumberFormat(language).format(n);
    return t(`${key}.${plurals.select(n) === "one" ? "one" : "other"}`, { n: shown, ...values });
  }

  /** A list of texts; none where there is no such key. @param {string} key @returns {string[]} */
  function tl(key) {
    const list = find(key);
    return Array.isArray(list) ? list : [];
  }

  /** True if there is such a text; for keys that the daemon chooses. @param {string} key */
  const has = (key) => find(key) !== undefined;

  /** Resolves once the other panels' texts are there. What failed is tried again when next asked for. */
  function all() {
    rest ??= fetchRest().then(
      (more) => Object.assign(catalogue, more),
      (error) => {
        rest = null;
        throw error;
      },
    );
    return rest;
  }

  return { t, tn, tl, has, all, language };
}

/** @param {Catalogue | undefined} part @param {string} name */
const below = (part, name) => (typeof part === "object" && !Array.isArray(part) ? part[name] : undefined);

/** @param {string} text @param {Values} values */
function filled(text, values) {
  return text.replace(/\{(\w+)\}/g, (place, name) => (name in values ? String(values[name]) : place));
}
