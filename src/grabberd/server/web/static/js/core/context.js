// The context that every panel is given.
import { el } from "./dom.js";
import { createAnnouncer } from "./announce.js";
import { createApi } from "./api.js";
import { createConfirm } from "./confirm.js";
import { createFormat } from "./format.js";
import { go } from "./router.js";
import { createStore, deviceOf } from "./store.js";
import { keptText } from "./kept.js";

/** @import { Texts, Values } from "./texts.js" */
/** @import { Announcement } from "./announce.js" */
/** @import { Question } from "./confirm.js" */
/** @import { Format } from "./format.js" */
/** @import { Store } from "./store.js" */
/** @import { Device, Role, Session, State } from "types/documents" */
/** @import { Api } from "types/routes" */

/** @type {Role[]} from the least to the highest */
const RANKS = ["viewer", "operator", "admin"];

/**
 * @typedef {object} Context
 * @property {Store} store
 * @property {Api} api
 * @property {(key: string, values?: Values) => string} t a text
 * @property {(key: string, n: number, values?: Values) => string} tn a text in the number's form
 * @property {(key: string) => string[]} tl a list of texts
 * @property {Texts} texts
 * @property {Format} format numbers, times, sizes
 * @property {(role: Role) => boolean} may true if the user of the page has this role, or a higher one
 * @property {() => Device | null} device the chosen one
 * @property {(text: string, options?: Announcement) => void} announce
 * @property {(problem: unknown) => null} refused tells why a request was refused
 * @property {(question: Question) => Promise<boolean>} confirm
 * @property {(...parts: string[]) => void} go to a panel: go("captures", id)
 * @property {() => number} now_ms the daemon's time, by this tablet's clock
 * @property {HTMLElement} toasts
 */

/**
 * @typedef {object} First what comes inside the page
 * @property {Session | null} session
 * @property {State | null} state
 * @property {string} now_utc the daemon's time when it wrote the page
 */

/** @param {First} first @param {Texts} texts @returns {Context} */
export function createContext(first, texts) {
  const store = createStore({
    session: first.session,
    state: first.state,
    connection: { online: true, since: Date.now() },
    device: keptText("device"),
    clockOffset_ms: Date.parse(first.now_utc) - arrived_ms(),
  });
  const api = createApi({ onUnauthorised: () => store.set({ session: null, state: null }) });
  const announcer = createAnnouncer(texts.t);
  const now_ms = () => Date.now() + store.get().clockOffset_ms;
  return {
    store, api, texts, go,
    t: texts.t, tn: texts.tn, tl: texts.tl,
    format: createFormat(texts.language, texts.t),
    may: (role) => rankOf(store.get().session) >= RANKS.indexOf(role),
    device: () => deviceOf(store.get()),
    announce: announcer.announce,
    refused: announcer.refused,
    confirm: createConfirm(texts.t),
    now_ms,
    toasts: el("div", {}, announcer.region),
  };
}

/** The place of a user's role in RANKS; nobody's is below all. @param {Session | null} session */
const rankOf = (session) => (session ? RANKS.indexOf(session.role) : -1);

/** Time of the page's first byte by this tablet's clock: the nearest it knows to the daemon writing `now_utc`. */
function arrived_ms() {
  const [timing] = performance.getEntriesByType("navigation");
  const start = (timing instanceof PerformanceNavigationTiming && timing.responseStart) || performance.now();
  return performance.timeOrigin + start;
}
