// The stream of previews of the chosen device: the newest counts.
import { createStream } from "../core/stream.js";
import { readPreview } from "./message.js";

/** @import { Context } from "../core/context.js" */
/** @import { Preview } from "./message.js" */

/**
 * @param {Context} context
 * @param {(preview: Preview) => void} take
 */
export function createFeed({ store }, take) {
  let reading = false;
  let ended = false;
  /** @type {ArrayBuffer | null} */
  let waiting = null;

  /** One at a time; of those that come meanwhile the last. @param {ArrayBuffer | string} message */
  async function read(message) {
    if (typeof message === "string") return;
    waiting = message;
    if (reading) return;
    reading = true;
    while (waiting) {
      const next = waiting;
      waiting = null;
      const preview = await readPreview(next).catch(() => null);
      if (preview && !ended) take(preview);
    }
    reading = false;
  }

  const stream = createStream(store, "/api/v1/preview", read);
  return {
    unmount() {
      ended = true;
      stream.end();
    },
  };
}
