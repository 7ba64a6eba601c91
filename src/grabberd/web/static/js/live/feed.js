// The stream of previews of the chosen device: the newest counts, and it comes back by itself.
import { deviceOf } from "../core/store.js";
import { readPreview } from "./message.js";

/** @import { Context } from "../core/context.js" */
/** @import { Preview } from "./message.js" */

const RETRY_MS = 2000;

/**
 * @param {Context} context
 * @param {(preview: Preview) => void} take
 */
export function createFeed({ store }, take) {
  /** @type {WebSocket | null} */
  let socket = null;
  let retry = 0;
  let reading = false;
  /** @type {ArrayBuffer | null} */
  let waiting = null;

  /** @param {string | undefined} device */
  function open(device) {
    close();
    if (!device) return;
    const address = new URL(`/api/v1/preview?device=${encodeURIComponent(device)}`, location.href);
    address.protocol = address.protocol.replace("http", "ws");
    const mine = new WebSocket(address);
    socket = mine;
    mine.binaryType = "arraybuffer";
    mine.addEventListener("message", (event) => read(event.data));
    mine.addEventListener("close", () => {
      if (socket === mine) retry = setTimeout(() => open(device), RETRY_MS);
    });
  }

  function close() {
    clearTimeout(retry);
    const old = socket;
    socket = null;
    waiting = null;
    old?.close();
  }

  /** One at a time; of those that come meanwhile the last. @param {ArrayBuffer} message */
  async function read(message) {
    waiting = message;
    if (reading) return;
    reading = true;
    while (waiting) {
      const next = waiting;
      waiting = null;
      const preview = await readPreview(next).catch(() => null);
      if (preview && socket) take(preview);
    }
    reading = false;
  }

  // Not while the daemon is away: the state's stream tells when it is back.
  const end = store.subscribe(
    (known) => (known.connection.online ? deviceOf(known)?.name : undefined),
    open,
  );
  return {
    unmount() {
      end();
      close();
    },
  };
}
