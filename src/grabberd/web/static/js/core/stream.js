// A WebSocket of the daemon for the chosen device, which comes back by itself.
import { deviceOf } from "./store.js";

/** @import { Store } from "./store.js" */

const RETRY_MS = 2000;

/**
 * @param {Store} store
 * @param {string} path below the daemon's address
 * @param {(message: ArrayBuffer | string) => void} take
 * @param {string[]} [protocols] subprotocols to ask for
 */
export function createStream(store, path, take, protocols = []) {
  /** @type {WebSocket | null} */
  let socket = null;
  let retry = 0;

  /** @param {string | undefined} device */
  function open(device) {
    close();
    if (!device) return;
    const address = new URL(`${path}?device=${encodeURIComponent(device)}`, location.href);
    address.protocol = address.protocol.replace("http", "ws");
    const mine = new WebSocket(address, protocols);
    socket = mine;
    mine.binaryType = "arraybuffer";
    mine.addEventListener("message", (event) => {
      if (socket === mine) take(event.data);
    });
    mine.addEventListener("close", () => {
      if (socket === mine) retry = setTimeout(() => open(device), RETRY_MS);
    });
  }

  function close() {
    clearTimeout(retry);
    const old = socket;
    socket = null;
    old?.close();
  }

  // Not while the daemon is away: the state's stream tells when it is back.
  const end = store.subscribe((known) => (known.connection.online ? deviceOf(known)?.name : undefined), open);
  return {
    end() {
      end();
      close();
    },
  };
}
