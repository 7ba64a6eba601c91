// The capture that runs, second by second, or how the last one ended.
import { el, fill, symbol } from "../core/dom.js";
import { ledgerIn, measuredBadge } from "../captures/words.js";
import { deviceOf } from "../core/store.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture } from "types/documents" */

const EVERY_MS = 1000;
const VERDICTS = { complete: ["good", "ok"], incomplete: ["warn", "warn"] };

/** @param {Context} context */
export function createLastCapture(context) {
  const { t, store, api } = context;
  const element = el("section", { class: "card last", "aria-label": t("operate.last.title") });
  let timer = 0;
  let ended = false;

  /** Asks until the newest capture is at rest; then again when another one begins. */
  async function look() {
    clearTimeout(timer);
    if (ended) return;
    try {
      const { captures } = await api.get(`/captures?limit=1&${new URLSearchParams({ device: context.device()?.name ?? "" })}`);
      fill(element, words(context, captures[0]));
      if (captures[0] && !atRest(captures[0])) timer = setTimeout(look, EVERY_MS);
    } catch {
      timer = setTimeout(look, 5 * EVERY_MS); // the banner says that the daemon is away
    }
  }

  const stop = store.subscribe((known) => deviceOf(known)?.capture_id ?? deviceOf(known)?.armed_capture_id, look);
  const back = store.subscribe((known) => known.connection.online, look);
  return {
    element,
    unmount() {
      ended = true;
      clearTimeout(timer);
      stop();
      back();
    },
  };
}

/** @param {Capture} capture */
function atRest(capture) {
  return capture.verdict !== null || capture.state === "armed";
}

/** @param {Context} context @param {Capture | undefined} capture */
function words(context, capture) {
  const { t, format } = context;
  if (!capture) return [el("h2", {}, t("operate.last.title")), el("p", { class: "muted" }, t("operate.last.none"))];
  const title = capture.state === "recording" ? `${capture.id} ${t("operate.last.running")}` : t("operate.last.title");
  const open = el("a", { class: "button", href: `#captures/${capture.id}` }, t("operate.last.open"));
  return [
    el("div", { class: "row between" }, el("h2", {}, title), el("span", { class: "row" }, verdict(context, capture), measuredBadge(context, capture.coverage))),
    el("div", { class: "row between" },
      el("p", { class: "last-facts" }, el("span", {}, format.moment(capture.created_utc)), " · ", context.tn("operate.last.fields", capture.fields), said(context, capture)),
      capture.verdict && open),
  ];
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
