// Listeners of an element that come and go together.

/**
 * @param {HTMLElement} element
 * @param {Record<string, (event: never) => void>} listeners by the event's name
 * @returns {() => void} takes all of them away
 */
export function listen(element, listeners) {
  const heard = new AbortController();
  // Not passive: what turns a wheel into a zoom keeps the page from scrolling with it.
  const options = { signal: heard.signal, passive: false };
  for (const [event, listener] of Object.entries(listeners)) element.addEventListener(event, /** @type {EventListener} */ (listener), options);
  return () => heard.abort();
}
