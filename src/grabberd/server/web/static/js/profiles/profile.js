// One profile as text: looked at, changed into a next version, retired; and its earlier versions.
import { ApiProblem } from "../core/api.js";
import { el, fill, symbol } from "../core/dom.js";
import { draftOf, keepDraft, resumedNote } from "../core/drafts.js";
import { everyPage } from "../core/pages.js";
import { BEGINNINGS, addressOf, saidOf } from "./words.js";

/** @import { PanelContext } from "../panels/index.js" */
/** @import { Profile, ProfileRow } from "types/documents" */
/** @import { Kind } from "./words.js" */

/** @param {PanelContext} context @param {Kind} kind @param {string} name empty for a new one */
export function createProfile(context, kind, name) {
  const { t, api, may } = context;
  const path = /** @type {`/profiles/${string}/${string}`} */ (`/profiles/${kind}/${encodeURIComponent(name)}`);
  const head = el("p", { class: "muted" });
  const text = el("textarea", { class: "input profile-text", id: "profile-text", rows: 24, disabled: Boolean(name), spellcheck: "false", readonly: !may("operator"), "aria-describedby": "profile-about" });
  const said = el("div", { role: "status" });
  const store = el("button", { class: "button primary", type: "button", disabled: Boolean(name), data: { do: "store" }, on: { click: put } }, symbol("ok"), t("profiles.store"));
  const retire = el("button", { class: "button", type: "button", data: { do: "retire" }, hidden: true, on: { click: remove } }, t("profiles.retire.do"));
  const versions = el("ul", { class: "profile-list", "aria-label": t("profiles.versions") });
  const history = el("section", { class: "card stack", hidden: !name }, el("h2", {}, t("profiles.versions")), versions);
  const editing = may("operator") ? el("div", { class: "row" }, store, retire) : el("p", { class: "muted" }, t("profiles.viewer"));
  const element = el("div", { class: "stack" }, head,
    el("section", { class: "card stack" }, el("label", { class: "field-label", for: "profile-text" }, t("profiles.text")), el("p", { class: "field-hint", id: "profile-about" }, t("profiles.textAbout")), text, said, editing), history);
  const draft = `profile.${kind}.${name}`;
  let newest = 0;
  let ended = false;
  text.addEventListener("input", () => keepDraft(draft, { text: text.value, after: String(newest) }));

  async function open() {
    if (!name) {
      text.value = BEGINNINGS[kind];
      return resume();
    }
    const [profile, listed] = await Promise.all([api.get(path), everyPage((query) => api.get(`${path}/versions?${query}`))]);
    if (ended) return;
    newest = profile.newest;
    show(profile);
    resume();
    fill(versions, ...listed.flatMap((page) => page.versions).map(item));
  }

  /** @param {Profile} profile */
  function show(profile) {
    fill(head, saidOf(context, { ...profile, note: "" }));
    text.value = profile.yaml;
    // Not before: what somebody wrote meanwhile would be overwritten.
    text.disabled = store.disabled = false;
    retire.hidden = profile.retired_utc !== null;
  }

  /** Goes on with what was typed; it still follows the version that it was begun with. */
  function resume() {
    const typed = draftOf(draft);
    if (!typed) return;
    text.value = typed.text;
    newest = Number(typed.after);
    fill(said, resumedNote(context, draft, again));
  }

  function again() {
    fill(said);
    open().catch(tell);
  }

  /** @param {ProfileRow} row */
  function item(row) {
    const look = async () => {
      const profile = await api.get(`${path}/versions/${row.version}`).catch(context.refused);
      if (profile && !ended) show(profile);
    };
    return el("li", {}, el("button", { class: "button plain profile-row", type: "button", data: { version: row.version }, disabled: row.problem !== null, on: { click: look } }, saidOf(context, row)));
  }

  async function put() {
    store.disabled = true;
    fill(said);
    try {
      const body = { yaml: text.value, after: newest };
      const profile = name ? await api.put(path, { body }) : await api.post("/profiles", { body });
      keepDraft(draft, null);
      const words = t(profile.version === newest ? "profiles.same" : "profiles.stored", { n: profile.version });
      if (!name) return void (location.hash = addressOf(profile.kind, profile.name));
      context.announce(words);
      await open();
    } catch (problem) {
      tell(problem);
    } finally {
      store.disabled = false;
    }
  }

  /** All that is wrong, in the instrument's own words. @param {unknown} problem */
  function tell(problem) {
    const { detail = "", hint = "" } = problem instanceof ApiProblem ? problem : {};
    const lines = (detail || t("core.noAnswer")).split("; ");
    fill(said, el("div", { class: "note is-bad" }, symbol("bad"), el("div", { lang: "en" }, el("ul", {}, lines.map((line) => el("li", {}, line))), el("p", {}, hint))));
  }

  async function remove() {
    const sure = await context.confirm({ title: t("profiles.retire.title", { name }), text: t("profiles.retire.text"), action: t("profiles.retire.do"), danger: true });
    if (!sure) return;
    const profile = await api.delete(path).catch(context.refused);
    if (profile && !ended) await open();
  }

  open().catch(tell);
  return { element, unmount: () => void (ended = true) };
}
