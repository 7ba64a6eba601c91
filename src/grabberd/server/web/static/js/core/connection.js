// The stream of the daemon's state: kept up by itself, and honest about when it is not.
import { merged } from "./store.js";

/** @import { Store } from "./store.js" */
/** @import { State } from "types/documents" */
/** @import { Api } from "types/routes" */

const RETRY_MS = 2000;
// More than the daemon's 15 s between keep-alives: those are comments, which reach no listener, so silence proves nothing.
const QUIET_MS = 20000;
const PING_MS = 5000;

/** @param {Store} store @param {Api} api */
export function createConnection(store, api) {
  /** @type {EventSource | null} */
  let source = null;
  let retry = 0;
  let heard = Date.now();

  function start() {
    stop();
    source = new EventSource(api.url("/events"));
    source.addEventListener("state", (event) => take(JSON.parse(event.data)));
    source.addEventListener("change", (event) => take(/** @type {State} */ (merged(store.get().state, JSON.parse(event.data)))));
    source.addEventListener("open", () => tell(true));
    source.addEventListener("error", () => again());
  }

  function stop() {
    clearTimeout(retry);
    source?.close();
    source = null;
  }

  /** @param {State} state */
  function take(state) {
    heard = Date.now();
    tell(true);
    store.set({ state });
  }

  /** @param {boolean} online */
  function tell(online) {
    heard = Date.now();
    if (store.get().connection.online !== online) store.set({ connection: { online, since: Date.now() } });
  }

  /** Reconnects. The session is asked for first, because an EventSource does not tell why it was refused. */
  function again() {
    stop();
    tell(false);
    retry = setTimeout(async () => {
      const known = await ask();
      if (known && store.get().session) start();
      else if (store.get().session) again();
    }, RETRY_MS);
  }

  /** Tells whether the daemon answers; a 401 makes the page ask for a token. */
  async function ask() {
    try {
      const session = await api.get("/session", { signal: AbortSignal.timeout(PING_MS) });
      store.set({ session: { ...store.get().session, ...session } });
      return true;
    } catch {
      return false;
    }
  }

  /** Asks the daemon after a long silence: a connection can break without an error. */
  async function watch() {
    if (!source || Date.now() - heard < QUIET_MS) return;
    if (await ask()) heard = Date.now();
    else if (source) again();
  }

  setInterval(watch, PING_MS);
  return { start, stop };
}
