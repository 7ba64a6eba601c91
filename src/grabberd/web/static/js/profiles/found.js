// Profiles that the labels of a capture find, offered to its analysis.
import { el, fill } from "../core/dom.js";
import { KINDS, addressOf } from "./words.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture, ProfileRow } from "types/documents" */

/** @param {Context} context @param {Capture} capture */
export function createFound(context, capture) {
  const { t, api } = context;
  const box = el("input", { type: "checkbox", data: { asked: "profiles" } });
  const names = el("ul");
  const element = el("fieldset", { class: "analysis-group", hidden: true, data: { group: "profiles" } }, el("legend", {}, t("profiles.found.title")), el("label", { class: "check" }, box, t("profiles.found.use")), names, el("p", { class: "field-hint" }, t("profiles.found.about")));

  async function look() {
    const wanted = KINDS.filter((kind) => capture.labels[kind]);
    const found = await Promise.all(wanted.map((kind) => api.get(`/profiles?${new URLSearchParams({ kind, name: capture.labels[kind] })}`).catch(() => ({ profiles: [] }))));
    const inUse = found.flatMap(({ profiles }) => profiles);
    fill(names, ...inUse.map(item));
    element.hidden = !inUse.length;
    // Here a person sees what is taken from where; a program has to ask for it.
    box.checked = inUse.length > 0;
  }

  /** @param {ProfileRow} one */
  const item = (one) => el("li", {}, el("a", { href: addressOf(one.kind, one.name) }, t("profiles.of", { kind: t(`profiles.kind.${one.kind}`), name: one.name })), `, ${t("profiles.version", { n: one.version })}`);

  look();
  return { element, wanted: () => box.checked };
}
