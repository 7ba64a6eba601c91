// The curves of the chosen device: what the daemon has kept of the last seconds, then what comes.
import { createStream } from "../core/stream.js";
import { readCurves } from "./curves_message.js";

/** @import { Context } from "../core/context.js" */
/** @import { Curves, CurvesMessage } from "./curves_message.js" */

const SILENT_MS = 1000;
const LOOK_MS = 500;

/**
 * @param {Pick<Context, "api" | "store">} context
 * @param {number} span_s
 * @param {(curves: Curves) => void} take told of every message, and while none comes, of the time that passes
 */
export function followCurves({ api, store }, span_s, take) {
  /** @type {Curves | null} */
  let curves = null;
  /** What came before the past did; null once that is there. @type {CurvesMessage[] | null} */
  let waiting = null;
  let heard_ms = performance.now();
  let turn = 0;

  /** The past, each time that the stream is opened: what was missed meanwhile is in it. @param {string} device */
  async function load(device) {
    const mine = (turn += 1);
    waiting = [];
    const past = await api.get(`/devices/${encodeURIComponent(device)}/curves?last_s=${span_s}`).catch(() => null);
    if (mine !== turn) return;
    const messages = [past, ...(waiting ?? [])];
    waiting = null;
    curves = null;
    for (const message of messages) if (message) curves = readCurves(curves, message, span_s);
    if (curves) take(curves);
  }

  /** @param {ArrayBuffer | string} text */
  function read(text) {
    if (typeof text !== "string") return;
    heard_ms = performance.now();
    const message = JSON.parse(text);
    if (waiting) {
      waiting.push(message);
      return;
    }
    curves = readCurves(curves, message, span_s);
    take(curves);
  }

  /** Nothing comes: what was last seen moves on into the past. */
  function look() {
    const silent_ms = performance.now() - heard_ms;
    if (curves && silent_ms > SILENT_MS) take({ ...curves, now_s: curves.now_s + silent_ms / 1000 });
  }

  const stream = createStream(store, "/api/v1/curves/stream", read, { opened: load });
  const ticking = setInterval(look, LOOK_MS);
  return {
    end() {
      turn += 1;
      clearInterval(ticking);
      stream.end();
    },
  };
}
