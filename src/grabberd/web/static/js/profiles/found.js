// Profiles that the labels of a capture find, offered to its analysis.
import { el, fill } from "../core/dom.js";
import { KINDS, addressOf } from "./words.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture, Profile } from "types/documents" */

/** @param {Context} context @param {Capture} capture @param {() => void} changed */
export function createFound(context, capture, changed) {
  const { t, api } = context;
  const box = el("input", { type: "checkbox", data: { asked: "profiles" }, on: { change: changed } });
  const names = el("ul");
  const element = el("fieldset", { class: "analysis-group", hidden: true, data: { group: "profiles" } }, el("legend", {}, t("profiles.found.title")), el("label", { class: "check" }, box, t("profiles.found.use")), names, el("p", { class: "field-hint" }, t("profiles.found.about")));
  /** @type {Set<string>} */
  let given = new Set();

  async function look() {
    const wanted = KINDS.filter((kind) => capture.labels[kind]);
    const listed = await Promise.all(wanted.map((kind) => api.get(`/profiles?${new URLSearchParams({ kind, name: capture.labels[kind] })}`).catch(() => ({ profiles: [] }))));
    const rows = listed.flatMap(({ profiles }) => profiles);
    const profiles = await Promise.all(rows.map((row) => api.get(/** @type {`/profiles/${string}/${string}`} */ (`/profiles/${row.kind}/${encodeURIComponent(row.name)}`)).catch(() => null)));
    const inUse = profiles.flatMap((one) => (one ? [one] : []));
    given = givenBy(inUse);
    fill(names, ...inUse.map(item));
    element.hidden = !inUse.length;
    // Here a person sees what is taken from where; a program has to ask for it.
    box.checked = inUse.length > 0;
    changed();
  }

  /** @param {Profile} one */
  const item = (one) => el("li", {}, el("a", { href: addressOf(one.kind, one.name) }, t("profiles.of", { kind: t(`profiles.kind.${one.kind}`), name: one.name })), `, ${t("profiles.version", { n: one.version })}`);

  look();
  return {
    element,
    wanted: () => box.checked,
    /** Inputs that the form need not be told, by the names of what lacks without them. */
    given: () => (box.checked ? given : new Set()),
  };
}

/** @param {Profile[]} profiles @returns {Set<string>} */
function givenBy(profiles) {
  const liner = profiles.map(({ profile }) => profile).find((one) => one.kind === "liner");
  const pulsator = profiles.map(({ profile }) => profile).find((one) => one.kind === "pulsator");
  /** @type {[string, unknown][]} */
  const inputs = [
    ["material", liner?.material],
    ...Object.entries(liner?.analysis ?? {}),
    // Without the lag nothing dates the settings, and they are left out.
    ["vacuum_pulsation", pulsator?.pulsation && liner?.lag],
    ["vacuum_liner", pulsator?.liner],
  ];
  return new Set(inputs.flatMap(([name, value]) => (value ? [name] : [])));
}
