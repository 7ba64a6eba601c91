// Before anything is drawn: light or dark, and the language, as they were chosen on this tablet.
(function () {
  /** @param {string} key @returns {unknown} */
  const kept = (key) => {
    try {
      return JSON.parse(localStorage.getItem(`grabberd.${key}`) ?? "null");
    } catch {
      return null; // a browser that keeps nothing
    }
  };
  const root = document.documentElement;
  const look = kept("look");
  if (look === "light" || look === "dark") root.dataset.look = look;
  const language = kept("language");
  if (language === "en" || language === "nb") root.lang = language;
})();
