// The stream of previews of the chosen device: what is asked for, what has been taken; the newest counts.
import { createStream } from "../core/stream.js";
import { readPreview } from "./message.js";

/** @import { Context } from "../core/context.js" */
/** @import { Preview } from "./message.js" */
/** @import { Illumination } from "types/documents" */

/**
 * @typedef {object} Ask
 * @property {"grey" | "bits"} picture
 * @property {{x: number, y: number, columns: number, lines: number} | null} part of the frame; null: all of it
 * @property {number} width_px pixels that the screen has for the width of the frame
 * @property {number} [rate_hz] at most
 * @property {boolean} light
 */

/**
 * @param {Context} context
 * @param {() => Ask} wanted
 * @param {(preview: Preview) => void} take
 * @param {(light: Illumination) => void} [lit]
 */
export function createFeed({ store }, wanted, take, lit) {
  let reading = false;
  let ended = false;
  let asked = "";
  /** @type {ArrayBuffer[]} */
  let waiting = [];

  /** One at a time; of those that come meanwhile the last. @param {ArrayBuffer | string} message */
  async function read(message) {
    if (typeof message === "string") return lit?.(JSON.parse(message));
    waiting.push(message);
    if (reading) return;
    reading = true;
    while (waiting.length) {
      const taken = waiting.length;
      const next = waiting[taken - 1];
      waiting = [];
      const preview = await readPreview(next).catch(() => null);
      if (preview && !ended) take(preview);
      // The daemon sends no more than is taken, and less of each where that is slow.
      stream.send(JSON.stringify({ taken }));
    }
    reading = false;
  }

  function ask() {
    const now = JSON.stringify({ ask: wanted() });
    if (now === asked) return;
    asked = now;
    stream.send(now);
  }

  const stream = createStream(store, "/api/v1/preview", read, {
    opened() {
      asked = "";
      ask();
    },
  });
  return {
    /** Asks for what is wanted now, if it is anything else. */
    ask,
    unmount() {
      ended = true;
      stream.end();
    },
  };
}
