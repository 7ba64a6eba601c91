// The capture that runs, second by second, or how the last one ended.
import { el, fill, symbol } from "../core/dom.js";
import { ledgerIn, measuredBadge } from "../captures/words.js";
import { deviceOf } from "../core/store.js";
import { createFirstSteps } from "./first_steps.js";
import { createProgress } from "./progress.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture } from "types/documents" */

const EVERY_MS = 1000;
const VERDICTS = { complete: ["good", "ok"], incomplete: ["warn", "warn"] };

/** @param {Context} context */
export function createLastCapture(context) {
  const { t, store, api } = context;
  const element = el("section", { class: "card last", "aria-label": t("operate.last.title") });
  const progress = createProgress(context);
  const first = createFirstSteps(context);
  let timer = 0;
  let ended = false;

  /** Asks until the newest capture is at rest; then again when another one begins. */
  async function look() {
    clearTimeout(timer);
    if (ended) return;
    try {
      const { captures } = await api.get(`/captures?limit=1&${new URLSearchParams({ device: context.device()?.name ?? "" })}`);
      if (captures[0]?.state === "recording") {
        progress.show(captures[0]);
        fill(element, head(context, captures[0]), progress.element);
      } else fill(element, captures[0] ? words(context, captures[0]) : first.element);
      if (captures[0] && !atRest(captures[0])) timer = setTimeout(look, EVERY_MS);
    } catch {
      timer = setTimeout(look, 5 * EVERY_MS); // the banner says that the daemon is away
    }
  }

  const stop = store.subscribe((known) => deviceOf(known)?.capture_id ?? deviceOf(known)?.armed_capture_id, look);
  const back = store.subscribe((known) => known.connection.online, look);
  return {
    element, look,
    unmount() {
      ended = true;
      clearTimeout(timer);
      progress.unmount();
      first.unmount();
      stop();
      back();
    },
  };
}

/** @param {Capture} capture */
function atRest(capture) {
  return capture.verdict !== null || capture.state === "armed";
}

/** @param {Context} context @param {Capture} capture */
function words(context, capture) {
  const { t, format } = context;
  const open = el("a", { class: "button", href: `#captures/${capture.id}` }, t("operate.last.open"));
  return [
    head(context, capture),
    el("div", { class: "row between" },
      el("p", { class: "last-facts" }, el("span", {}, format.moment(capture.created_utc)), " · ", context.tn("operate.last.fields", capture.fields), said(context, capture)),
      capture.verdict && open),
  ];
}

/** What it is, and how it has come out. @param {Context} context @param {Capture} capture */
function head(context, capture) {
  const { t } = context;
  const { cow, teat, name } = capture.labels;
  const of = [name, cow && t("operate.last.cow", { cow }), teat].filter(Boolean).join(", ");
  const title = capture.state === "recording" ? t("operate.last.now") : t("operate.last.title");
  return el("div", { class: "row between" }, el("h2", {}, of ? `${title}: ${of}` : title), el("span", { class: "row" }, verdict(context, capture), measuredBadge(context, capture.coverage)));
}

/** @param {Context} context @param {Capture} capture */
function verdict({ t }, capture) {
  if (capture.state === "recording" || capture.state === "armed") return null;
  const [level, sign] = capture.verdict ? VERDICTS[capture.verdict] : ["idle", "wait"];
  return el("span", { class: `badge is-${level}` }, symbol(sign), t(`operate.last.${capture.verdict ?? "sealing"}`));
}

/** The ledger in words, unless the capture is complete. @param {Context} context @param {Capture} capture */
function said(context, capture) {
  return capture.ledger.complete ? "" : ` · ${ledgerIn(context, capture)}`;
}
