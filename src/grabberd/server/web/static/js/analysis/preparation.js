// What an analysis will be made with: what is known and from where, what is lacking and what that would give.
import { el, fill, symbol } from "../core/dom.js";
import { addressOf } from "../profiles/words.js";
import { knownIn } from "./known.js";

/** @import { Context } from "../core/context.js" */
/** @import { AnalysisPreparation, Capture } from "types/documents" */

/** Where what is lacking can be had. @type {Record<string, (capture: Capture) => string>} */
const WAYS = {
  profiles: (capture) => `#captures/${encodeURIComponent(capture.id)}`,
  liner_profile: () => "#profiles/liner",
  pulsator_profile: () => "#profiles/pulsator",
  cup_profile: () => "#profiles/cup",
  cow_profile: () => "#profiles/cow",
  material: () => "#tests/ramp",
  material_first_end_mm_material_last_end_mm: linerOf,
  vacuum_lag: () => "#tests/milking",
  vacuum_pulsation: () => "#profiles",
  vacuum_liner: () => "#profiles",
  reference: linerOf,
  plane: linerOf,
  flow_stop: () => "#profiles/cow",
};

/** @param {Context} context @param {Capture} capture */
export function createPreparation(context, capture) {
  const { t } = context;
  const known = el("section", { class: "stack" });
  const lacks = el("section", { class: "stack", hidden: true });
  const problems = el("div", { role: "alert" });
  const element = el("div", { class: "analysis-preparation" }, problems, known, lacks);
  wait();

  function wait() {
    fill(known, el("h3", {}, t("analysis.known.title")), el("div", { class: "awaited", role: "status", "aria-label": t("analysis.known.wait") }, el("span"), el("span"), el("span")));
  }

  /** @param {AnalysisPreparation} found */
  function show(found) {
    const rows = knownIn(context, found);
    const list = rows.length ? el("dl", { class: "analysis-known" }, rows.map(row)) : el("p", { class: "muted" }, t("analysis.known.none"));
    fill(known, el("h3", {}, t("analysis.known.title")), list);
    known.hidden = !rows.length && Boolean(found.problems?.length);
    const lacking = lacksIn(found);
    lacks.hidden = !lacking.length;
    fill(lacks, el("h3", {}, t("analysis.lacking.title")), el("ul", { class: "analysis-lacking" }, lacking.map(item)));
    fill(problems, found.problems?.length ? refusal(found) : null);
  }

  /** @param {ReturnType<typeof knownIn>[number]} one */
  function row(one) {
    return el("div", { data: { known: one.name } }, el("dt", {}, one.label), el("dd", {}, el("b", { class: "number" }, one.value), el("span", { class: "small muted" }, one.source)));
  }

  /** Each lack once, by its slug. @param {AnalysisPreparation} found @returns {{slug: string, words: string}[]} */
  function lacksIn({ lacks: said = [] }) {
    const slugs = said.map((words) => ({ slug: slugOf(words), words }));
    // Without any vacuum one line says it.
    const both = ["vacuum_pulsation", "vacuum_liner"].every((one) => slugs.some(({ slug }) => slug === one));
    const once = slugs.filter(({ slug }, i) => !(both && slug === "vacuum_liner") && slugs.findIndex((one) => one.slug === slug) === i);
    // A profile that is missing is why the others are.
    return [...once.filter(({ slug }) => slug.includes("profile")), ...once.filter(({ slug }) => !slug.includes("profile"))];
  }

  /** @param {{slug: string, words: string}} lack */
  function item({ slug, words }) {
    const { texts } = context;
    const name = capture.labels[slug.split("_")[0]] ?? "";
    const what = texts.has(`analysis.lack.${slug}`) ? t(`analysis.lack.${slug}`, { name }) : words;
    const way = WAYS[slug]?.(capture);
    const got = slug.endsWith("_profile") ? "profile" : slug === "vacuum_liner" ? "vacuum_pulsation" : slug;
    const how = texts.has(`analysis.get.${got}`) ? t(`analysis.get.${got}`) : "";
    return el("li", { data: { lack: slug } }, symbol("info"), el("span", {}, what, " ", way && how ? el("a", { href: way }, how) : how));
  }

  /** Everything at once, in the instrument's own words. @param {AnalysisPreparation} found */
  function refusal(found) {
    const lines = (found.problems ?? []).flatMap((one) => one.split("; "));
    return el("div", { class: "note is-bad", data: { refused: "" } }, symbol("bad"), el("div", {}, el("strong", {}, t("analysis.refused")), el("ul", { lang: "en" }, lines.map((line) => el("li", {}, line))), found.hint && el("p", { lang: "en" }, found.hint)));
  }

  /** It cannot be told. @param {string} words @param {string} hint */
  function fail(words, hint) {
    known.hidden = false;
    fill(known, el("div", { class: "note is-bad" }, symbol("bad"), el("div", {}, el("strong", {}, words), hint && el("p", {}, hint))));
    lacks.hidden = true;
    fill(problems);
  }

  return { element, show, wait, fail };
}

/** @param {Capture} capture */
function linerOf({ labels }) {
  return labels.liner ? addressOf("liner", labels.liner) : "#profiles/liner";
}

/** Key of what is lacking, from the daemon's words: "vacuum.lag: without it …". @param {string} words */
const slugOf = (words) => words.split(":")[0].trim().replace(/\W+/g, "_");
