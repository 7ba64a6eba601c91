// What a test offers to the liner's profile, to be stored by a press.
import { el, fill, symbol } from "../core/dom.js";
import { addressOf } from "../profiles/words.js";
import { note } from "./words.js";

/** @import { Context } from "../core/context.js" */
/** @import { LinerTest, Profile } from "types/documents" */

/** @typedef {NonNullable<LinerTest["offer"]>} Offer */

/** @param {Context} context @param {string} id of the test @param {Offer} offer */
export function createOffer(context, id, offer) {
  const { t, api, may } = context;
  const liner = String(offer.profile.name);
  const path = /** @type {`/profiles/${string}/${string}`} */ (`/profiles/liner/${encodeURIComponent(liner)}`);
  const store = el("button", { class: "button primary large", type: "button", data: { do: "accept" }, on: { click: accept } }, symbol("ok"), t("tests.offer.do"));
  const place = el("div", { class: "stack", role: "status" });
  const element = el("section", { class: "card stack", "aria-labelledby": "tests-offer", data: { offer: liner } }, el("h2", { id: "tests-offer" }, t("tests.offer.title", { liner })),
    el("ul", { lang: "en", class: "tests-changes" }, offer.changes.map((one) => el("li", {}, one))), place);
  let ended = false;

  async function open() {
    const newest = await api.get(path).catch(() => null);
    if (!ended) show(newest);
  }

  /** @param {Profile | null} newest */
  function show(newest) {
    const version = newest?.version ?? 0;
    if (newest && isSame(newest.profile, offer.profile)) fill(place, note("good", el("p", { data: { stored: version } }, t("tests.offer.stored", { n: version })), link()));
    else if (version !== offer.after) fill(place, note("warn", el("p", {}, t("tests.offer.late", { n: version, after: offer.after })), link()));
    else fill(place, may("operator") ? el("div", { class: "row" }, store) : note("idle", t("profiles.viewer")));
  }

  const link = () => el("p", {}, el("a", { href: addressOf("liner", liner) }, t("profiles.of", { kind: t("profiles.kind.liner"), name: liner })));

  async function accept() {
    store.disabled = true;
    try {
      const stored = await api.post(`/tests/${encodeURIComponent(id)}/accept`);
      if (ended) return;
      context.announce(t("tests.offer.stored", { n: stored.version }), { kind: "good" });
      show(stored);
    } catch (problem) {
      context.refused(problem);
      if (!ended) await open();
    }
    store.disabled = false;
  }

  open();
  return { element, unmount: () => void (ended = true) };
}

/** True for JSON that says the same, in whatever sequence. @param {unknown} one @param {unknown} other @returns {boolean} */
export function isSame(one, other) {
  if (one === null || other === null || typeof one !== "object" || typeof other !== "object") return one === other;
  const [ours, theirs] = [Object.entries(one), new Map(Object.entries(other))];
  return Array.isArray(one) === Array.isArray(other) && ours.length === theirs.size && ours.every(([key, value]) => theirs.has(key) && isSame(value, theirs.get(key)));
}
