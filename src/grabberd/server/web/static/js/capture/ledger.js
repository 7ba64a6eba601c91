// A capture with more of its ledger than its document lists.
import { atRest } from "../captures/words.js";

/** @import { Capture, LedgerPage } from "types/documents" */
/** @import { Api } from "types/routes" */

const PAGE = 500;
const PAGES = 6; // more could not be told apart in a strip, nor drawn fluently

/** @param {Api} api @param {`/captures/${string}`} path @returns {Promise<Capture>} */
export async function captureWithLedger(api, path) {
  const capture = await api.get(path);
  const { entries_not_listed = 0, events_not_listed = 0, entries: first, events: changes } = capture.ledger;
  if (!atRest(capture) || !(entries_not_listed || events_not_listed)) return capture;
  const { entries, events } = await pagesOf(api, path);
  const missing = { entries_not_listed: first.length + entries_not_listed - entries.length, events_not_listed: changes.length + events_not_listed - events.length };
  return { ...capture, ledger: { ...capture.ledger, entries, events, ...missing } };
}

/** @param {Api} api @param {`/captures/${string}`} path */
async function pagesOf(api, path) {
  /** @type {Pick<Capture["ledger"], "entries" | "events">} */
  const all = { entries: [], events: [] };
  /** @type {string | null | undefined} */
  let cursor = "0~0";
  for (let page = 0; page < PAGES && cursor; page += 1) {
    /** @type {LedgerPage} */
    const found = await api.get(`${path}/ledger?limit=${PAGE}&cursor=${encodeURIComponent(cursor)}`);
    all.entries.push(...found.entries);
    all.events.push(...found.events);
    cursor = found.next;
  }
  return all;
}
