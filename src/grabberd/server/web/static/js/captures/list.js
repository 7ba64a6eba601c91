// The captures that were asked for, part by part as the list is scrolled; those in the making are kept up to date.
import { el, fill, setText, symbol } from "../core/dom.js";
import { createBlock } from "./block.js";
import { followKeys } from "./keys.js";
import { ZONE } from "./question.js";
import { take } from "./sparkline.js";
import { atRest } from "./words.js";

/** @import { Context } from "../core/context.js" */
/** @import { Known } from "../core/store.js" */
/** @import { Block } from "./block.js" */
/** @import { Question } from "./question.js" */
/** @import { Selection } from "./selection.js" */
/** @import { Capture, CaptureFacets, CaptureList } from "types/documents" */

const PART = 25;
const EVERY_MS = 1000;
/** Rows so far beyond the screen are in the document. */
const NEAR = "1500px";
/** As many as the daemon lists at once. */
const MOST = 500;
/** Where the list was left: who comes back goes on from there. */
let left = { asked: "", rows: 0, y: 0 };

/**
 * @param {Context} context
 * @param {Question} question
 * @param {Selection} selection
 * @param {{counted: (facets: CaptureFacets) => void, search: () => void}} hooks
 */
export function createList(context, question, selection, hooks) {
  const { t, tn, api, store } = context;
  const count = el("p", { class: "muted", role: "status" });
  const blocks = el("div", { class: "stack capture-blocks" });
  const more = el("button", { class: "button wide", type: "button", hidden: true, on: { click: further } }, symbol("down"), t("captures.older"));
  const fresh = el("button", { class: "button primary capture-fresh", type: "button", hidden: true, on: { click: () => begin(true) } }, t("captures.fresh"));
  const empty = el("div", { class: "card stack", hidden: true });
  const element = el("div", { class: "stack" }, count, fresh, blocks, empty, more);
  /** @type {Block[]} */
  let parts = [];
  /** @type {string | null} */
  let next = null;
  let turn = 0;
  let timer = 0;
  let loading = false;

  const sight = new IntersectionObserver((seen) => seen.forEach((one) => parts.find((part) => part.element === one.target)?.near(one.isIntersecting)), { rootMargin: NEAR });
  const end = new IntersectionObserver((seen) => seen.some((one) => one.isIntersecting) && further(), { rootMargin: "400px" });

  /** @param {string} [cursor] @param {number} [limit] @returns {Promise<CaptureList | null>} */
  async function ask(cursor, limit = PART) {
    const mine = ++turn;
    clearTimeout(timer);
    const query = question.query();
    query.set("limit", String(limit));
    if (cursor) query.set("cursor", cursor);
    else for (const [name, value] of [["facets", "true"], ["zone", ZONE]]) query.set(name, value);
    const page = await api.get(`/captures?${query}`).catch(context.refused);
    if (mine !== turn) return null; // a later question has been asked meanwhile
    if (page) for (const one of page.captures) if (page.widths_mm?.[one.id]) take(one, page.widths_mm[one.id]);
    return page;
  }

  /** Shows the first part anew. What was loaded after it stays where it still follows, or where somebody reads it. @param {boolean} [top] scrolls to it */
  async function begin(top = false) {
    const back = !top && !parts.length && left.asked === question.query().toString();
    const page = await ask(undefined, back ? Math.min(MOST, Math.max(PART, left.rows)) : PART);
    if (!page) return;
    blocks.classList.remove("is-stale");
    const same = parts[0]?.captures().map((one) => one.id).join() === page.captures.map((one) => one.id).join();
    const reads = !top && !same && parts.length > 1 && element.getBoundingClientRect().top < -innerHeight;
    fresh.hidden = !reads;
    if (same && !top) parts[0].show(page.captures);
    else if (!reads) {
      sight.disconnect();
      parts = [];
      next = page.next ?? null;
      fill(blocks);
      for (let first = 0; first < page.captures.length; first += PART) append(page.captures.slice(first, first + PART));
      if (top || back) window.scrollTo(0, back ? left.y : 0);
    }
    if (page.facets) hooks.counted(page.facets);
    show(page);
  }

  async function further() {
    if (!next || loading) return;
    loading = true;
    const page = await ask(next);
    loading = false;
    if (!page) return;
    next = page.next ?? null;
    append(page.captures);
    show(page);
  }

  /** @param {Capture[]} captures */
  function append(captures) {
    const block = createBlock(context, selection, captures);
    parts.push(block);
    blocks.append(block.element);
    sight.observe(block.element);
  }

  /** @param {CaptureList} page */
  function show({ total, in_all }) {
    more.hidden = next === null;
    empty.hidden = total > 0;
    if (!total) fill(empty, question.isNarrow() ? el("p", {}, t("captures.nothing")) : howTo(t));
    setText(count, total === in_all ? tn("captures.shown", total) : tn("captures.found", total, { all: context.format.number(in_all) }));
    wait();
    // Anew, because it tells of changes alone: the end may have stayed in sight.
    end.unobserve(more);
    end.observe(more);
  }

  function wait() {
    clearTimeout(timer);
    if (parts.some((part) => !part.captures().every(atRest))) timer = setTimeout(look, EVERY_MS);
  }

  /** Asks for those that are not at rest. */
  async function look() {
    const mine = turn;
    const asked = parts.flatMap((part) => part.captures().filter((one) => !atRest(one)));
    const found = await Promise.all(asked.map((one) => api.get(`/captures/${one.id}`).catch(() => null)));
    if (mine !== turn) return;
    if (found.some((one) => !one || atRest(one))) return begin();
    for (const part of parts) part.show(part.captures().map((one) => found.find((other) => other?.id === one.id) ?? one));
    wait();
  }

  const ends = [
    store.subscribe((known) => known.connection.online && changesOf(known), (changes) => changes !== false && begin()),
    followKeys(blocks, { search: hooks.search, toggle: (id) => toggle(id), none: selection.clear }),
  ];

  /** @param {string} id */
  function toggle(id) {
    const found = all().find((one) => one.id === id);
    if (found) selection.set(found, !selection.has(id));
  }

  const all = () => parts.flatMap((part) => part.captures());
  return {
    element,
    shown: all,
    /** Something else is asked for: what is shown is seen to be of before, until the answer is there. */
    search() {
      blocks.classList.add("is-stale");
      begin(true);
    },
    reload: () => begin(),
    mark: () => parts.forEach((part) => part.mark()),
    unmount() {
      left = { asked: question.query().toString(), rows: all().length, y: window.scrollY };
      turn = -1;
      clearTimeout(timer);
      sight.disconnect();
      end.disconnect();
      ends.forEach((one) => one());
    },
  };
}

/** The captures that run or wait, and the analyses that have ended last, as one text. @param {Known} known */
function changesOf(known) {
  const devices = Object.values(known.state?.devices ?? {});
  return devices.map(({ capture_id, armed_capture_id, latest_analysis: one }) => `${capture_id} ${armed_capture_id} ${one?.capture} ${one?.state} ${one?.analysis}`).join();
}

/** @param {(key: string) => string} t */
function howTo(t) {
  return [el("h2", {}, t("captures.none")), el("p", {}, t("captures.how")), el("p", {}, el("a", { class: "button primary", href: "#operate" }, symbol("operate"), t("captures.toOperate")))];
}
