// Which liner is tested, and what else its captures are labelled with. Kept on this tablet.
import { el, fill } from "../core/dom.js";
import { keep, kept } from "../core/kept.js";
import { NOTHING, OTHERS, wishFrom } from "./wish.js";

/** @import { Context } from "../core/context.js" */
/** @import { ProfileRow } from "types/documents" */
/** @import { Wish } from "./wish.js" */

const KEPT = "tests.wish";
const MOST = 500;

/** What was filled in last. @returns {Wish} */
export const keptWish = () => wishFrom(kept(KEPT) ?? NOTHING);

/** @param {Wish} wish */
export const keepWish = (wish) => keep(KEPT, wish);

/** @param {Context} context @param {Wish} wish which is changed @param {() => void} changed */
export function createLiner(context, wish, changed) {
  const { t, api } = context;
  const known = el("select", { class: "input", id: "test-liner", data: { liner: "" }, on: { change: choose } });
  const name = el("input", { class: "input", id: "test-liner-name", maxlength: 64, autocomplete: "off", value: wish.liner, on: { input: () => set(name.value) } });
  const own = el("label", { class: "field", for: "test-liner-name", hidden: true }, el("span", { class: "field-label" }, t("tests.liner.name")), name, el("span", { class: "field-hint" }, t("tests.liner.own")));
  const others = el("div", { class: "tests-others" });
  const more = el("details", { hidden: true }, el("summary", { class: "capture-summary" }, t("tests.liner.more")), others);
  const element = el("section", { class: "card stack" }, el("div", { class: "tests-liner" }, el("label", { class: "field", for: "test-liner" }, el("span", { class: "field-label" }, t("tests.liner.title")), known), own), more);
  let ended = false;

  async function open() {
    const { profiles } = await api.get(`/profiles?limit=${MOST}`);
    if (ended) return;
    const named = (/** @type {string} */ kind) => profiles.filter((row) => row.kind === kind && !row.problem).sort(byName);
    offer(named("liner").map((row) => row.name));
    const offered = OTHERS.filter((kind) => named(kind).length);
    fill(others, ...offered.map((kind) => other(kind, named(kind).map((row) => row.name))));
    more.hidden = !offered.length;
    more.open = offered.some((kind) => wish.labels[kind]);
  }

  /** @param {string[]} names */
  function offer(names) {
    const isOwn = !names.includes(wish.liner) && (wish.liner !== "" || !names.length);
    const first = names.length ? [el("option", { value: "", selected: !wish.liner }, t("tests.liner.choose"))] : [];
    fill(known, ...first, ...names.map((one) => el("option", { value: one, selected: one === wish.liner }, one)), el("option", { value: "\n", selected: isOwn }, t("tests.liner.another")));
    own.hidden = !isOwn;
  }

  function choose() {
    const isOwn = known.value === "\n";
    own.hidden = !isOwn;
    name.value = "";
    set(isOwn ? "" : known.value);
    if (isOwn) name.focus();
  }

  /** The numbers were of the other liner. @param {string} liner */
  function set(liner) {
    if (liner.trim() !== wish.liner.trim()) wish.numbers = {};
    wish.liner = liner;
    keepWish(wish);
    changed();
  }

  /** @param {string} kind @param {string[]} names */
  function other(kind, names) {
    const select = el("select", { class: "input", data: { label: kind } }, ["", ...names].map((one) => el("option", { value: one, selected: one === (wish.labels[kind] ?? "") }, one || "–")));
    select.addEventListener("change", () => {
      wish.labels[kind] = select.value;
      keepWish(wish);
    });
    return el("label", { class: "field" }, el("span", { class: "field-label" }, t(`profiles.kind.${kind}`)), select);
  }

  open().catch(context.refused);
  return { element, unmount: () => void (ended = true) };
}

/** @param {ProfileRow} one @param {ProfileRow} other */
const byName = (one, other) => one.name.localeCompare(other.name, undefined, { numeric: true });
