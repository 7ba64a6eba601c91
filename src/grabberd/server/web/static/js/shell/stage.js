// The place of the panels: one at a time.
import { el, fill } from "../core/dom.js";
import { routeOf } from "../core/router.js";

/** @import { Context } from "../core/context.js" */
/** @import { Entry, Panel } from "../panels/index.js" */

const AHEAD_MS = 2000; // the first panel's own picture and curves come before this

/** Tells if the browser was asked to spare the link, as over a mobile one; not every browser can be asked. */
function savesData() {
  return "connection" in navigator && Boolean(/** @type {{ saveData?: boolean }} */ (navigator.connection).saveData);
}

/**
 * @param {Context} context
 * @param {Entry[]} entries
 * @param {HTMLElement} main
 * @param {(id: string) => void} mark tells the navigation which is shown
 */
export function createStage(context, entries, main, mark) {
  /** @type {ReturnType<Panel["mount"]> | null} */
  let shown = null;
  let turn = 0;
  let running = false;

  function clear() {
    shown?.unmount?.();
    shown = null;
    turn += 1;
  }

  async function follow() {
    if (!running) return;
    const { entry, parameters } = routeOf(entries, location.hash);
    mark(entry.under ?? entry.id);
    await mount(entry, parameters);
  }

  /** @param {Entry} entry @param {Record<string, string>} parameters */
  async function mount(entry, parameters) {
    clear();
    const mine = turn;
    // At once: under a tab that is lit already, the panel before must not be read as this one.
    fill(main, el("div", { class: "panel skeleton", "aria-busy": true }, el("span", { class: "visually-hidden" }, context.t("core.loading"))));
    const panel = await load(entry);
    if (mine !== turn || !panel) return;
    const element = el("div", { class: `panel panel-${entry.id}`, data: { panel: entry.id } });
    fill(main, element);
    document.title = `${context.t(panel.title)} – grabberd`;
    try {
      shown = panel.mount(element, { ...context, parameters });
    } catch (error) {
      fail(error);
    }
    window.scrollTo(0, 0);
  }

  /** @param {Entry} entry */
  async function load(entry) {
    try {
      const [module] = await Promise.all([entry.load(), entry === entries[0] || context.texts.all()]);
      return module.panel;
    } catch (error) {
      fail(error);
      return null;
    }
  }

  /** Fetches the other panels and their texts while nobody waits for one: their modules import each other, level after level. */
  async function loadAhead() {
    try {
      await context.texts.all();
      for (const entry of entries) await entry.load();
    } catch (error) {
      console.warn("The other panels were not loaded ahead.", error); // whoever asks for one is told
    }
  }

  /** @param {unknown} error */
  function fail(error) {
    console.error(error);
    const again = el("button", { class: "button", type: "button", on: { click: () => location.reload() } }, context.t("core.reload"));
    fill(main, el("div", { class: "card stack" }, el("p", {}, context.t("core.notLoaded")), el("div", {}, again)));
  }

  addEventListener("hashchange", follow);
  return {
    start() {
      if (running) return;
      running = true;
      follow();
      if (!savesData()) setTimeout(loadAhead, AHEAD_MS);
    },
    /** Shows something else than a panel. @param {Node} node */
    show(node) {
      running = false;
      clear();
      fill(main, node);
    },
  };
}
