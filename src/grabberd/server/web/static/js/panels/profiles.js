// Profiles: what is known of liners, pulsators, cups and cows.
import { el, symbol } from "../core/dom.js";
import { createProfileList } from "../profiles/list.js";
import { createProfile } from "../profiles/profile.js";
import { KINDS } from "../profiles/words.js";

/** @import { PanelContext } from "./index.js" */

export const panel = {
  title: "profiles.title",

  /** @param {HTMLElement} element @param {PanelContext} context */
  mount(element, context) {
    const { t } = context;
    const { kind = "", name = "" } = context.parameters;
    const known = KINDS.find((one) => one === kind);
    if (!known) {
      const list = createProfileList(context);
      element.append(el("div", {}, back("captures", t("core.nav.captures")), el("h1", {}, t("profiles.title"))), el("p", {}, t("profiles.about")), list.element);
      return list;
    }
    const profile = createProfile(context, known, name);
    element.append(el("div", {}, back("profiles", t("profiles.title")), el("h1", {}, name ? t("profiles.of", { kind: t(`profiles.kind.${known}`), name }) : t("profiles.new", { kind: t(`profiles.kind.${known}`) }))), profile.element);
    return profile;
  },
};

/** @param {string} route @param {string} words */
const back = (route, words) => el("a", { class: "button plain", href: `#${route}` }, symbol("back"), words);
