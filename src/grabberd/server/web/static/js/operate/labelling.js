// What is typed while a capture runs, or after it, labels that capture: as soon as the typing pauses.
import { statusOf } from "../core/api.js";

/** @import { Context } from "../core/context.js" */
/** @import { Wish } from "./wish.js" */

const PAUSE_MS = 600;
const NOT_FOUND = 404;
const NOTE = " "; // no label has that name

/**
 * @param {Context} context
 * @param {Wish} wish
 * @param {{gone: () => void, sent: () => void}} told the capture is no longer there; it has all of them now
 */
export function createLabelling(context, wish, told) {
  const { api, store } = context;
  let timer = 0;
  /** What was typed and is not sent: names of labels, or NOTE. Somebody else's capture keeps its other labels. @type {Set<string>} */
  const typed = new Set();

  /** Sends what was typed to its capture, and to those of its group. */
  async function send() {
    clearTimeout(timer);
    if (!typed.size || !wish.of) return;
    const { of } = wish;
    const sending = [...typed];
    typed.clear();
    const labels = Object.fromEntries(sending.filter((name) => name !== NOTE).map((name) => [name, (wish.labels[name] ?? "").trim() || null]));
    const body = { labels, ...(sending.includes(NOTE) ? { note: wish.note.trim() } : {}) };
    try {
      const capture = await api.patch(`/captures/${encodeURIComponent(of)}`, { body });
      const others = capture.group ? (await api.get(`/capture-groups/${encodeURIComponent(capture.group.id)}`)).captures.filter(({ id }) => id !== capture.id) : [];
      for (const { id } of others) await api.patch(`/captures/${encodeURIComponent(id)}`, { body });
      if (!typed.size) told.sent();
    } catch (problem) {
      if (wish.of !== of) return context.refused(problem); // another capture is typed for by now: it must not get these
      if (statusOf(problem) === NOT_FOUND) return told.gone();
      for (const name of sending) typed.add(name); // sent again when the daemon is back, or with the next letter
      context.refused(problem);
    }
  }

  const back = store.subscribe((known) => known.connection.online, (online) => online && send());
  return {
    /** Something was typed: a label of that name, or the note. @param {string | null} label */
    changed(label) {
      if (!wish.of) return;
      typed.add(label ?? NOTE);
      clearTimeout(timer);
      timer = setTimeout(send, PAUSE_MS);
    },
    send,
    unmount() {
      back();
      send();
    },
  };
}
