// Every profile by its newest version, kind by kind.
import { el, fill } from "../core/dom.js";
import { everyPage } from "../core/pages.js";
import { KINDS, addressOf, saidOf } from "./words.js";

/** @import { Context } from "../core/context.js" */
/** @import { ProfileRow } from "types/documents" */
/** @import { Kind } from "./words.js" */

/** @param {Context} context */
export function createProfileList(context) {
  const { t, api, may } = context;
  const place = el("div", { class: "stack" });
  const retired = el("input", { type: "checkbox", on: { change: load } });
  const element = el("div", { class: "stack" }, el("label", { class: "check" }, retired, t("profiles.showRetired")), place);
  let turn = 0;

  async function load() {
    const mine = ++turn;
    const pages = await everyPage((query) => api.get(`/profiles?${query}&retired=${retired.checked}`)).catch(context.refused);
    if (mine !== turn || !pages) return;
    const rows = pages.flatMap((page) => page.profiles);
    fill(place, ...KINDS.map((kind) => section(kind, rows.filter((row) => row.kind === kind))));
  }

  /** @param {Kind} kind @param {ProfileRow[]} rows */
  function section(kind, rows) {
    const make = may("operator") ? el("a", { class: "button", href: `#profiles/${kind}` }, t("profiles.make")) : null;
    const sorted = rows.sort((one, other) => one.name.localeCompare(other.name, undefined, { numeric: true }));
    const list = sorted.length ? el("ul", { class: "profile-list" }, sorted.map(item)) : el("p", { class: "muted" }, t("profiles.none"));
    return el("section", { class: "card stack", data: { kind } }, el("div", { class: "row between" }, el("h2", {}, t(`profiles.kinds.${kind}`)), make), list);
  }

  /** @param {ProfileRow} row */
  function item(row) {
    return el("li", {}, el("a", { class: "profile-row", href: addressOf(row.kind, row.name), data: { profile: row.name } }, el("strong", {}, row.name), el("span", { class: "small" }, saidOf(context, row))));
  }

  load();
  return { element, unmount: () => void (turn = -1) };
}
