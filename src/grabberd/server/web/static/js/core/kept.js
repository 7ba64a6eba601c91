// The user's choices, kept on this tablet. Never a token.

/** A kept value, or null. Of unknown type, because an older edition of the page may have kept it. @param {string} key @returns {unknown} */
export function kept(key) {
  try {
    return JSON.parse(localStorage.getItem(`grabberd.${key}`) ?? "null");
  } catch {
    return null;
  }
}

/** A text that was kept, or null. @param {string} key */
export function keptText(key) {
  const value = kept(key);
  return typeof value === "string" ? value : null;
}

/** @param {string} key @param {unknown} value null forgets it */
export function keep(key, value) {
  try {
    if (value === null) localStorage.removeItem(`grabberd.${key}`);
    else localStorage.setItem(`grabberd.${key}`, JSON.stringify(value));
  } catch {
    // a browser that keeps nothing
  }
}
