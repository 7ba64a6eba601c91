// The captures, newest first, page by page; those that run or wait stand on top and are kept up to date.
import { el, fill, setText, symbol } from "../core/dom.js";
import { createRow } from "./row.js";
import { atRest } from "./words.js";

/** @import { Context } from "../core/context.js" */
/** @import { Known } from "../core/store.js" */
/** @import { Capture } from "types/documents" */

const PAGE = 25;
const EVERY_MS = 1000;

/**
 * @param {Context} context
 * @param {{query: () => URLSearchParams, isNarrow: () => boolean}} search
 */
export function createList(context, search) {
  const { t, tn, api, store } = context;
  const count = el("p", { class: "muted", role: "status" });
  const list = el("ul", { class: "capture-list", "aria-label": t("captures.title") });
  const more = el("button", { class: "button wide", type: "button", hidden: true, on: { click: () => load(next) } }, symbol("down"), t("captures.older"));
  const empty = el("div", { class: "card stack", hidden: true });
  const element = el("div", { class: "stack" }, count, list, empty, more);
  /** @type {Capture[]} */
  let captures = [];
  /** @type {Map<string, ReturnType<typeof createRow>>} */
  const rows = new Map();
  /** @type {string | null} */
  let next = null;
  let turn = 0;
  let timer = 0;

  /** The first page, or the one after those that are shown. @param {string | null} [cursor] */
  async function load(cursor = null) {
    const mine = ++turn;
    clearTimeout(timer);
    const query = search.query();
    query.set("limit", String(cursor ? PAGE : Math.max(PAGE, captures.length)));
    if (cursor) query.set("cursor", cursor);
    const page = await api.get(`/captures?${query}`).catch(context.refused);
    if (mine !== turn || !page) return; // a later question has been asked meanwhile
    captures = cursor ? [...captures, ...page.captures] : page.captures;
    next = page.next ?? null;
    show();
  }

  function show() {
    const sorted = [...captures.filter((one) => !atRest(one)), ...captures.filter(atRest)];
    fill(list, ...sorted.map((one) => rowOf(one).element));
    more.hidden = next === null;
    empty.hidden = captures.length > 0;
    if (!captures.length) fill(empty, search.isNarrow() ? el("p", {}, t("captures.nothing")) : howTo(t));
    setText(count, captures.length ? tn("captures.shown", captures.length) : "");
    clearTimeout(timer);
    if (captures.some((one) => !atRest(one))) timer = setTimeout(look, EVERY_MS);
  }

  /** @param {Capture} capture */
  function rowOf(capture) {
    const row = rows.get(capture.id) ?? createRow(context, capture);
    rows.set(capture.id, row);
    row.show(capture);
    return row;
  }

  /** Asks for those that are not at rest. */
  async function look() {
    const mine = turn;
    const asked = captures.filter((one) => !atRest(one));
    const found = await Promise.all(asked.map((one) => api.get(`/captures/${one.id}`).catch(() => null)));
    if (mine !== turn) return;
    if (found.includes(null)) return load();
    captures = captures.map((one) => found.find((other) => other?.id === one.id) ?? one);
    show();
  }

  const ends = [
    store.subscribe((known) => currentOf(known), () => load()),
    store.subscribe((known) => analysedOf(known), () => load()),
    store.subscribe((known) => known.connection.online, (online) => online && load()),
  ];
  return {
    element,
    /** Something else is searched for. */
    search() {
      captures = [];
      load();
    },
    unmount() {
      turn = -1;
      clearTimeout(timer);
      ends.forEach((end) => end());
    },
  };
}

/** The captures that run or wait, as one text. @param {Known} known */
function currentOf(known) {
  const devices = Object.values(known.state?.devices ?? {});
  return devices.map((device) => `${device.capture_id} ${device.armed_capture_id}`).join();
}

/** The analyses that have ended last, as one text. @param {Known} known */
function analysedOf(known) {
  const devices = Object.values(known.state?.devices ?? {});
  return devices.map(({ latest_analysis: one }) => `${one?.capture} ${one?.state} ${one?.analysis}`).join();
}

/** @param {(key: string) => string} t */
function howTo(t) {
  return [el("h2", {}, t("captures.none")), el("p", {}, t("captures.how")), el("p", {}, el("a", { class: "button primary", href: "#operate" }, symbol("operate"), t("captures.toOperate")))];
}
