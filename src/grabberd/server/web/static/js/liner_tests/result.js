// A test that is done: verdict, checks with what to do, quantities, what it offers, its report.
import { statusOf } from "../core/api.js";
import { el, fill, symbol } from "../core/dom.js";
import { createHistory } from "./history.js";
import { createOffer } from "./offer.js";
import { VERDICTS, checkIn, keyOf, kindIn, note, quantityIn, sentence, valueIn, verdictBadge } from "./words.js";

/** @import { Context } from "../core/context.js" */
/** @import { LinerTest, TestCheck } from "types/documents" */

const RANKS = ["failed", "not certain", "not checked", "passed"];
/** @param {TestCheck} one @param {TestCheck} other */
const worstFirst = (one, other) => RANKS.indexOf(one.verdict) - RANKS.indexOf(other.verdict);

/** @param {Context} context @param {string} id */
export function createResult(context, id) {
  const { t, tn, api, format } = context;
  const path = /** @type {const} */ (`/tests/${encodeURIComponent(id)}`);
  const element = el("div", { class: "stack" }, el("p", { class: "muted", role: "status" }, t("tests.loading")));
  /** @type {{unmount: () => void}[]} */
  let parts = [];
  let ended = false;

  async function open() {
    const test = await api.get(path);
    if (ended) return;
    const offer = test.offer ? createOffer(context, id, test.offer) : null;
    const history = createHistory(context);
    parts = [history, ...(offer ? [offer] : [])];
    history.show(test.liner ?? "");
    fill(element, head(test), offer?.element, el("div", { class: "tests-two" }, checks(test), el("div", { class: "stack" }, found(test), sources(test))), history.element);
  }

  /** @param {LinerTest} test */
  function head(test) {
    const [level, sign] = VERDICTS[test.verdict];
    const about = [test.liner && t("tests.of", { liner: test.liner }), format.moment(test.created_utc)].filter(Boolean).join(" · ");
    return el("div", { class: `verdict is-${level}`, data: { result: test.verdict } }, symbol(sign),
      el("div", { class: "stack grow" }, el("h2", {}, t(`tests.result.${keyOf(test.verdict)}`, { test: kindIn(context, test.kind) })), el("p", {}, about),
        el("div", { class: "row" }, el("a", { class: "button", href: api.url(`${path}/report`), target: "_blank", rel: "noopener" }, symbol("download"), t("tests.report")), el("a", { class: "button", href: `#tests/${test.kind}` }, t("tests.again")))));
  }

  /** @param {LinerTest} test */
  function checks(test) {
    return el("section", { class: "card stack", "aria-labelledby": "tests-checks" }, el("h2", { id: "tests-checks" }, t("tests.checks")), el("ul", { class: "tests-checks" }, [...test.checks].sort(worstFirst).map(check)), problems(test.problems ?? []));
  }

  /** @param {TestCheck} one */
  function check(one) {
    const value = one.value === null || one.value === undefined ? "" : valueIn(context, one.value, one.sigma, one.unit ?? "");
    const [level] = VERDICTS[one.verdict];
    return el("li", { class: `tests-check is-${level}`, data: { check: one.name } },
      el("div", { class: "row between" }, el("strong", {}, checkIn(context, one)), verdictBadge(context, one.verdict)),
      (value || one.limit) && el("p", { class: "small" }, value, value && one.limit && " · ", one.limit && el("span", { class: "muted", lang: "en" }, one.limit)),
      one.reason && el("p", { lang: "en" }, sentence(one.reason)),
      one.remedy && el("p", { class: "tests-remedy" }, el("strong", {}, t("tests.remedy"), " "), el("span", { lang: "en" }, sentence(one.remedy))));
  }

  /** @param {LinerTest} test */
  function found(test) {
    const rows = test.quantities.map((one) => el("tr", { data: { quantity: one.name } }, el("th", { scope: "row" }, quantityIn(context, one), one.value === null && one.reason && el("p", { lang: "en", class: "small muted" }, sentence(one.reason))), el("td", { class: "number" }, valueIn(context, one.value, one.sigma, one.unit))));
    return el("section", { class: "card stack", "aria-labelledby": "tests-found", hidden: !rows.length }, el("h2", { id: "tests-found" }, t("tests.found")), el("div", { class: "scroll", tabindex: 0 }, el("table", { class: "table tests-table" }, el("tbody", {}, rows))));
  }

  /** @param {LinerTest} test */
  function sources(test) {
    const links = test.captures.map((one, at) => el("li", {}, el("a", { href: `#captures/${encodeURIComponent(one.id)}` }, format.moment(one.captured_utc)), test.analyses?.[at] ? [" · ", el("a", { href: `#analysis/${encodeURIComponent(one.id)}/${test.analyses[at]}` }, t("capture.analysis", { n: test.analyses[at] }))] : ""));
    return el("section", { class: "card stack", "aria-labelledby": "tests-sources" }, el("h2", { id: "tests-sources" }, tn("tests.sources", links.length)), el("ul", { class: "tests-sources" }, links));
  }

  /** @param {string[]} all */
  function problems(all) {
    return all.length ? note("warn", el("ul", { lang: "en" }, all.map((one) => el("li", {}, one)))) : null;
  }

  /** @param {unknown} problem */
  function refused(problem) {
    if (statusOf(problem) === 404) fill(element, note("warn", t("tests.gone")));
    else context.refused(problem);
  }

  open().catch(refused);
  return {
    element,
    unmount() {
      ended = true;
      parts.forEach((part) => part.unmount());
    },
  };
}
