// What every panel is given.
import { el } from "./dom.js";
import { createAnnouncer } from "./announce.js";
import { createApi } from "./api.js";
import { createConfirm } from "./confirm.js";
import { createFormat } from "./format.js";
import { createHistory } from "./history.js";
import { go } from "./router.js";
import { createStore, deviceOf } from "./store.js";
import { createTexts } from "./texts.js";
import { kept } from "./kept.js";

const RANKS = ["viewer", "operator", "admin"];

/**
 * @typedef {object} Context
 * @property {ReturnType<typeof createStore>} store
 * @property {ReturnType<typeof createApi>} api
 * @property {(key: string, values?: any) => string} t a text
 * @property {(key: string, n: number, values?: any) => string} tn a text in the number's form
 * @property {(key: string) => string[]} tl a list of texts
 * @property {ReturnType<typeof createTexts>} texts
 * @property {ReturnType<typeof createFormat>} format numbers, times, sizes
 * @property {(role: string) => boolean} may whether who uses the page has this role, or more
 * @property {() => any} device the chosen device's document, or null
 * @property {(text: string, options?: any) => void} announce
 * @property {(problem: any) => void} refused says what a request was refused with
 * @property {(question: any) => Promise<boolean>} confirm
 * @property {(...parts: string[]) => void} go to a panel: go("captures", id)
 * @property {() => number} now_ms the daemon's time, by this tablet's clock
 * @property {ReturnType<typeof createHistory>} history what events said in the last minutes
 * @property {HTMLElement} toasts
 */

/** @param {any} first what came with the page @param {any} catalogue @param {string} language @returns {Context} */
export function createContext(first, catalogue, language) {
  const store = createStore({
    session: first.session,
    state: first.state,
    connection: { online: true, since: Date.now() },
    device: kept("device"),
    clockOffset_ms: Date.parse(first.now_utc) - arrived_ms(),
  });
  const api = createApi({ onUnauthorised: () => store.set({ session: null, state: null }) });
  const texts = createTexts(catalogue, language);
  const announcer = createAnnouncer(texts.t);
  const now_ms = () => Date.now() + store.get().clockOffset_ms;
  return {
    store, api, texts, go,
    t: texts.t, tn: texts.tn, tl: texts.tl,
    format: createFormat(language, texts.t),
    may: (role) => RANKS.indexOf(store.get().session?.role ?? "") >= RANKS.indexOf(role),
    device: () => deviceOf(store.get()),
    announce: announcer.announce,
    refused: announcer.refused,
    confirm: createConfirm(texts.t),
    now_ms,
    history: createHistory(store, now_ms),
    toasts: el("div", {}, announcer.region),
  };
}

/** When the page's first bytes came, by this tablet's clock: nearest to when the daemon wrote them. */
function arrived_ms() {
  const [timing] = performance.getEntriesByType("navigation");
  const start = /** @type {any} */ (timing)?.responseStart || performance.now();
  return performance.timeOrigin + start;
}
