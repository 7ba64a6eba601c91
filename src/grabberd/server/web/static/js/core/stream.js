// A WebSocket of the daemon for the chosen device, which comes back by itself; none while nobody sees the page.
import { deviceOf } from "./store.js";

/** @import { Store } from "./store.js" */

const RETRY_MS = 2000;

/**
 * @typedef {object} Options
 * @property {string[]} [protocols] subprotocols to ask for
 * @property {(device: string) => void} [opened] called each time that it is open
 */

/**
 * @param {Store} store
 * @param {string} path below the daemon's address
 * @param {(message: ArrayBuffer | string) => void} take
 * @param {Options} [options]
 */
export function createStream(store, path, take, { protocols = [], opened } = {}) {
  /** @type {WebSocket | null} */
  let socket = null;
  let retry = 0;

  function open() {
    close();
    const { connection } = store.get();
    const device = deviceOf(store.get())?.name;
    // Not while the daemon is away: the state's stream tells when it is back.
    if (!device || !connection.online || document.hidden) return;
    const address = new URL(`${path}?device=${encodeURIComponent(device)}`, location.href);
    address.protocol = address.protocol.replace("http", "ws");
    const mine = new WebSocket(address, protocols);
    socket = mine;
    mine.binaryType = "arraybuffer";
    mine.addEventListener("open", () => {
      if (socket === mine) opened?.(device);
    });
    mine.addEventListener("message", (event) => {
      if (socket === mine) take(event.data);
    });
    mine.addEventListener("close", () => {
      if (socket === mine) retry = setTimeout(open, RETRY_MS);
    });
  }

  function close() {
    clearTimeout(retry);
    const old = socket;
    socket = null;
    old?.close();
  }

  document.addEventListener("visibilitychange", open);
  const end = store.subscribe((known) => (known.connection.online ? deviceOf(known)?.name : undefined), open);
  return {
    /** Says something, unless nobody would hear it. @param {string} text */
    send(text) {
      if (socket?.readyState === WebSocket.OPEN) socket.send(text);
    },
    end() {
      document.removeEventListener("visibilitychange", open);
      end();
      close();
    },
  };
}
