// What this tablet remembers of its user's choices. Never a token.

/** @param {string} key @param {any} [otherwise] */
export function kept(key, otherwise = null) {
  try {
    const text = localStorage.getItem(`grabberd.${key}`);
    return text === null ? otherwise : JSON.parse(text);
  } catch {
    return otherwise;
  }
}

/** @param {string} key @param {any} value null forgets it */
export function keep(key, value) {
  try {
    if (value === null) localStorage.removeItem(`grabberd.${key}`);
    else localStorage.setItem(`grabberd.${key}`, JSON.stringify(value));
  } catch {
    // a browser that keeps nothing
  }
}
