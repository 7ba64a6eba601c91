// The tests that were made, the newest first.
import { el, fill } from "../core/dom.js";
import { addressOf, kindIn, quantitiesIn, verdictBadge } from "./words.js";

/** @import { Context } from "../core/context.js" */
/** @import { LinerTestRow } from "types/documents" */

const AT_ONCE = 20;
const SHOWN = 3;

/** @param {Context} context */
export function createHistory(context) {
  const { t, api, format } = context;
  const title = el("h2", { id: "tests-history" });
  const list = el("ul", { class: "tests-list" });
  const more = el("button", { class: "button", type: "button", hidden: true, on: { click: () => load(cursor) } }, t("tests.history.more"));
  const element = el("section", { class: "card stack", "aria-labelledby": "tests-history" }, title, list, el("div", { class: "row" }, more));
  let liner = "";
  let cursor = "";
  let turn = 0;

  /** Those of a liner; of all where it has no name. @param {string} name */
  function show(name) {
    liner = name.trim();
    fill(title, liner ? t("tests.history.of", { liner }) : t("tests.history.title"));
    fill(list);
    load("");
  }

  /** @param {string} from cursor of the page */
  async function load(from) {
    const mine = ++turn;
    const asked = new URLSearchParams({ limit: String(AT_ONCE), ...(liner ? { liner } : {}), ...(from ? { cursor: from } : {}) });
    const page = await api.get(`/tests?${asked}`).catch(() => null);
    if (mine !== turn) return;
    cursor = page?.next ?? "";
    more.hidden = !cursor;
    list.append(...(page?.tests ?? []).map(item));
    if (!list.childElementCount) fill(list, el("li", { class: "muted" }, t("tests.history.none")));
  }

  /** @param {LinerTestRow} row */
  function item(row) {
    if (row.problem || !row.kind || !row.verdict) return el("li", { class: "tests-row", data: { test: row.id } }, el("span", { lang: "en" }, row.problem));
    const when = row.created_utc ? format.moment(row.created_utc) : "";
    const found = quantitiesIn(context, row.quantities, SHOWN);
    return el("li", {}, el("a", { class: "tests-row", href: addressOf(row), data: { test: row.id } },
      el("span", { class: "tests-row-what" }, el("strong", {}, kindIn(context, row.kind)), el("span", { class: "small muted" }, [when, liner ? "" : row.liner].filter(Boolean).join(" · "))),
      verdictBadge(context, row.verdict), found && el("span", { class: "small tests-row-found" }, found), row.offers && el("span", { class: "badge is-idle" }, t("tests.history.offers"))));
  }

  return { element, show, unmount: () => void (turn = NaN) };
}
