// Who uses the page, in which language, light or dark, and the way out.
import { el, fill, symbol } from "../core/dom.js";
import { keep, keptText } from "../core/kept.js";
import { deviceOf } from "../core/store.js";

/** @import { Context } from "../core/context.js" */
/** @import { Session } from "types/documents" */

const LANGUAGES = { en: "English", nb: "Norsk" };

/** @param {Context} context */
export function createMenu(context) {
  const { t, store } = context;
  const who = el("div", { class: "menu-who" });
  const device = el("div", {});
  const sheet = el("div", { class: "menu-sheet" }, who, device, language(context), look(context), help(context));
  const summary = el("summary", { class: "button plain", "aria-label": t("core.menu") }, symbol("menu"));
  const menu = el("details", { class: "menu" }, summary, sheet);
  store.subscribe((known) => known.session, (session) => fill(who, session && person(context, session)));
  store.subscribe((known) => Object.keys(known.state?.devices ?? {}).join(), () => fill(device, devices(context)));
  addEventListener("click", (event) => {
    if (menu.open && !menu.contains(/** @type {Node} */ (event.target))) menu.open = false;
  });
  menu.addEventListener("keydown", (event) => {
    if (event.key !== "Escape") return;
    menu.open = false;
    summary.focus();
  });
  addEventListener("hashchange", () => (menu.open = false));
  return menu;
}

/** @param {Context} context @param {Session} session */
function person({ t, api, store, refused }, session) {
  const role = el("strong", { data: { role: session.role } }, t(`core.role.${session.role}`));
  const name = session.token ? el("span", { class: "muted" }, session.token) : el("span", { class: "muted" }, t("core.noTokens"));
  const out = el("button", { class: "button wide", type: "button" }, t("core.signOut"));
  out.addEventListener("click", async () => {
    try {
      await api.delete("/session");
      store.set({ session: null, state: null });
    } catch (problem) {
      refused(problem);
    }
  });
  return [el("p", { class: "menu-role" }, symbol("person"), el("span", {}, role, " ", name)), session.by === "session" && out];
}

/** The choice of a device, where there are several. @param {Context} context */
function devices({ t, store }) {
  const names = Object.keys(store.get().state?.devices ?? {});
  if (names.length < 2) return null;
  const present = deviceOf(store.get())?.name;
  return choice(t("core.device"), Object.fromEntries(names.map((name) => [name, name])), present, (name) => {
    keep("device", name);
    location.reload(); // nothing of the other one stays on the page
  });
}

/** @param {Context} context */
function language({ t, texts }) {
  return choice(t("core.language"), LANGUAGES, texts.language, (chosen) => {
    keep("language", chosen);
    location.reload();
  });
}

/** @param {Context} context */
function look({ t }) {
  const looks = { auto: t("core.look.auto"), light: t("core.look.light"), dark: t("core.look.dark") };
  return choice(t("core.look.title"), looks, keptText("look") ?? "auto", (chosen) => {
    keep("look", chosen === "auto" ? null : chosen);
    if (chosen === "auto") delete document.documentElement.dataset.look;
    else document.documentElement.dataset.look = chosen;
  });
}

/** @param {Context} context */
function help({ t }) {
  return el("p", { class: "menu-help" }, el("a", { href: "/docs" }, t("core.docs")));
}

/** @param {string} label @param {Record<string, string>} options @param {string | undefined} present @param {(value: string) => void} chosen */
function choice(label, options, present, chosen) {
  const made = Object.entries(options).map(([value, words]) => el("option", { value, selected: value === present }, words));
  const select = el("select", { class: "input" }, made);
  select.addEventListener("change", () => chosen(select.value));
  return el("label", { class: "field" }, el("span", { class: "field-label" }, label), select);
}
