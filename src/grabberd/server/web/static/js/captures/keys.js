// The list by keyboard: arrows go, space chooses, Enter opens as with every link, / searches, Escape chooses none.

/**
 * @param {HTMLElement} list
 * @param {{search: () => void, toggle: (id: string) => void, none: () => void}} acts
 * @returns {() => void} ends it
 */
export function followKeys(list, acts) {
  /** @param {KeyboardEvent} event */
  function press(event) {
    if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]")) return;
    const isTyping = event.target instanceof Element && event.target.matches("input:not([type=checkbox]), select, textarea");
    if (event.key === "/" && !isTyping) acts.search();
    else if (event.key === "ArrowDown" && event.target instanceof Element && event.target.matches("[type=search]")) links()[0]?.focus();
    else if (isTyping || !inList(event)) return;
    else if (!at(event)) return;
    event.preventDefault();
  }

  /** True if the key meant something. @param {KeyboardEvent} event */
  function at({ key }) {
    const all = links();
    const place = all.findIndex((one) => one === document.activeElement || one.parentElement?.contains(document.activeElement));
    if (key === "ArrowDown" || key === "ArrowUp") all[place + (key === "ArrowDown" ? 1 : -1)]?.focus();
    else if (key === " ") acts.toggle(all[place]?.parentElement?.dataset.capture ?? "");
    else if (key === "Escape") acts.none();
    else return false;
    return true;
  }

  /** @param {KeyboardEvent} event */
  const inList = ({ target }) => target instanceof Node && list.contains(target);
  const links = () => /** @type {HTMLElement[]} */ ([...list.querySelectorAll(".capture-row")]);
  addEventListener("keydown", press);
  return () => removeEventListener("keydown", press);
}
