// A capture replayed, at an address that says at which field.
import { captureWithLedger } from "../capture/ledger.js";
import { createStrip } from "../capture/strip.js";
import { atRest, labelsIn, periodOf } from "../captures/words.js";
import { statusOf } from "../core/api.js";
import { el, fill, symbol } from "../core/dom.js";
import { createMarks } from "../replay/marks.js";
import { createRoom } from "../replay/room.js";
import { openAnalysis, openRun, pathOf, readableOf } from "../replay/source.js";
import { analysedVacuum, recordedVacuum } from "../replay/vacuum.js";

/** @import { PanelContext } from "./index.js" */
/** @import { Capture, Views } from "types/documents" */

const EVERY_MS = 1000;
const ADDRESS_MS = 400;
const READINGS = 200_000;

export const panel = {
  title: "replay.title",

  /** @param {HTMLElement} element @param {PanelContext} context */
  mount(element, context) {
    const { t, api, format, store } = context;
    const { id = "", n: begin } = context.parameters;
    const title = el("h1", {}, t("replay.title"));
    const runs = el("div", { class: "row" });
    const link = el("button", { class: "button", type: "button", data: { do: "link" }, on: { click: giveLink } }, t("replay.link"));
    const tools = el("div", { class: "row" }, runs, link);
    const said = el("div", { role: "status" });
    const place = el("div", { class: "stack" });
    const marks = createMarks(context, { id, at: () => room?.at() ?? 0, go: (n) => room?.go(n), changed: take });
    const strip = createStrip(context, (n) => room?.go(n));
    const below = el("div", { class: "replay-below" }, el("section", { class: "card stack", "aria-label": t("capture.fields") }, el("h2", {}, t("capture.fields")), strip.element), marks.element);
    /** @type {ReturnType<typeof createRoom> | null} */
    let room = null;
    /** @type {Capture | null} */
    let capture = null;
    let timer = 0;
    let addressing = 0;
    let turn = 0;

    /** What is known of the capture now. @param {Capture} now */
    function take(now) {
      const grew = !capture || readableOf(now) !== readableOf(capture);
      capture = now;
      strip.show(now);
      marks.show(now);
      room?.mark(now.marks ?? []);
      if (grew) room?.grown();
    }

    /** @param {number | null} wanted run; null: the newest */
    async function open(wanted) {
      const mine = ++turn;
      clearTimeout(timer);
      try {
        const now = await captureWithLedger(api, pathOf(id));
        if (mine !== turn) return;
        const labels = labelsIn(context, now);
        fill(title, t("replay.of", { when: format.moment(now.created_utc) }), labels && ` · ${labels}`);
        const problem = problemOf(now);
        fill(said, problem && note(problem.level, problem.words), !atRest(now) && !problem && note("is-busy", t("replay.recording")));
        if (problem) {
          if (!atRest(now)) timer = setTimeout(() => open(wanted), EVERY_MS);
          return;
        }
        await show(now, wanted, mine);
      } catch (problem) {
        if (mine === turn) refused(problem, wanted);
      }
    }

    /** @param {Capture} now @param {number | null} wanted @param {number} mine */
    async function show(now, wanted, mine) {
      const run = wanted ?? now.runs.at(-1)?.run ?? null;
      const [measured, analysis] = await Promise.all([run === null ? null : openRun(api, id, run), now.runs.length ? openAnalysis(api, id).catch(() => null) : null]);
      if (mine !== turn) return;
      const at = room?.at() ?? (Number(begin ?? NaN) >= 0 ? Number(begin) : now.pre_trigger_fields);
      room?.end();
      capture = now;
      const views = () => (measured && Object.keys(measured.views).length ? measured.views : viewsNow(now));
      room = createRoom(context, { capture: now, measured, analysis, total: () => readableOf(capture ?? now), now: () => capture ?? now, views, moved: address }, at);
      fill(runs, runChoice(now, run));
      fill(place, room.element, below, room.film);
      if (!tools.contains(room.full)) tools.append(room.full);
      take(now);
      room.grown();
      giveVacuum(analysis && analysedVacuum(analysis.document, periodOf(now)), mine);
      if (!atRest(now)) timer = setTimeout(() => follow(run, mine), EVERY_MS);
    }

    /** A capture that is being recorded grows; once it rests it is opened anew. @param {number | null} run @param {number} mine */
    async function follow(run, mine) {
      const now = await api.get(pathOf(id)).catch(() => null);
      if (mine !== turn) return;
      if (now && (atRest(now) || (run === null && now.runs.length))) return open(null);
      if (now) take(now);
      timer = setTimeout(() => follow(run, mine), EVERY_MS);
    }

    /** @param {ReturnType<typeof analysedVacuum>} known @param {number} mine */
    async function giveVacuum(known, mine) {
      const document = capture?.channels ? await api.get(`${pathOf(id)}/channels?max_readings=${READINGS}`).catch(() => null) : null;
      if (mine === turn) room?.giveVacuum(recordedVacuum(document?.channels ?? []) ?? known);
    }

    /** @param {Capture} now @param {number | null} run */
    function runChoice(now, run) {
      if (now.runs.length < 2) return null;
      const select = el("select", { class: "input", "aria-label": t("replay.run"), on: { change: () => open(Number(select.value)) } }, [...now.runs].reverse().map((one) => el("option", { value: one.run, selected: one.run === run }, t("replay.runOf", { n: one.run, when: format.moment(one.created_utc) }))));
      return select;
    }

    /** Why there is nothing to be replayed. @param {Capture} now */
    function problemOf(now) {
      if (now.state === "damaged") return { level: "is-bad", words: t("replay.damaged", { reason: now.ended_because ?? "" }) };
      if (now.state === "armed") return { level: "is-idle", words: t("replay.armed") };
      return readableOf(now) ? null : { level: "is-idle", words: t(atRest(now) ? "replay.empty" : "replay.begins") };
    }

    /** The views as its grabber is set now. @param {Capture} now @returns {Views} */
    const viewsNow = (now) => store.get().state?.devices?.[now.device]?.views ?? {};

    /** Keeps the address at the field, without a new step of the browser's way back. @param {number} n */
    function address(n) {
      clearTimeout(addressing);
      addressing = setTimeout(() => history.replaceState(history.state, "", `#replay/${encodeURIComponent(id)}/${n}`), ADDRESS_MS);
    }

    async function giveLink() {
      const target = new URL(`#replay/${encodeURIComponent(id)}/${room?.at() ?? 0}`, location.href).href;
      const copied = await navigator.clipboard?.writeText(target).then(() => true, () => false);
      context.announce(copied ? t("replay.linkCopied") : target, { kind: copied ? "good" : "info", hint: copied ? target : t("replay.linkHint") });
    }

    /** @param {unknown} problem @param {number | null} wanted */
    function refused(problem, wanted) {
      if (statusOf(problem) === 0) timer = setTimeout(() => open(wanted), EVERY_MS); // the banner says that the daemon is away
      else if (statusOf(problem) === 404) fill(said, note("is-warn", t("capture.gone")));
      else context.refused(problem);
    }

    const back = el("a", { class: "button plain", href: `#captures/${encodeURIComponent(id)}` }, symbol("back"), t("capture.title"));
    element.append(el("div", { class: "row between replay-head" }, el("div", {}, back, title), tools), said, place);
    fill(said, note("is-idle", t("shape.loading")));
    open(null);
    return {
      unmount() {
        turn = NaN;
        clearTimeout(timer);
        clearTimeout(addressing);
        room?.end();
      },
    };
  },
};

/** @param {string} level @param {string} words */
const note = (level, words) => el("div", { class: `note ${level}` }, symbol(level === "is-bad" ? "bad" : level === "is-warn" ? "warn" : "info"), el("p", {}, words));
