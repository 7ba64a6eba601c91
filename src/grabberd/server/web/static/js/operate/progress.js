// A capture that runs: how far it has come, how long it still takes, what it has lost, and what is found.
import { el, setText } from "../core/dom.js";
import { deviceOf, rateOf } from "../core/store.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture } from "types/documents" */

const EVERY_MS = 250;
const NOT_WHOLE = /** @type {const} */ (["lost", "damaged", "overrun"]);

/**
 * How far a capture has come.
 * @param {Pick<Capture, "trigger_utc" | "created_utc" | "pre_trigger_fields" | "length_fields">} capture
 * @param {number} now_ms by the daemon's clock
 * @param {number} rate_hz
 */
export function progressOf(capture, now_ms, rate_hz) {
  const begun_ms = Date.parse(capture.trigger_utc ?? capture.created_utc) - (capture.pre_trigger_fields / rate_hz) * 1000;
  const whole_s = capture.length_fields === null || capture.length_fields === undefined ? null : capture.length_fields / rate_hz;
  const since_s = Math.max(0, (now_ms - begun_ms) / 1000);
  if (whole_s === null) return { done_s: since_s, left_s: null, share: null };
  const done_s = Math.min(since_s, whole_s);
  return { done_s, left_s: whole_s - done_s, share: done_s / whole_s };
}

/** @param {Context} context */
export function createProgress(context) {
  const { t, tn, format, store, now_ms } = context;
  const bar = el("progress", { class: "capture-progress", max: 1, "aria-label": t("operate.progress.title") });
  const time = el("p", { class: "capture-time" });
  const fields = el("p", { class: "last-facts" });
  const element = el("div", { class: "stack" }, bar, time, fields);
  /** @type {Capture | null} */
  let capture = null;

  function tick() {
    if (!capture) return;
    const device = deviceOf(store.get());
    const { done_s, left_s, share } = progressOf(capture, now_ms(), rateOf(device));
    if (share === null) bar.removeAttribute("value");
    else bar.value = share;
    setText(time, left_s === null ? t("operate.progress.open", { done: format.duration(done_s) }) : t("operate.progress.left", { done: format.duration(done_s), left: format.duration(Math.ceil(left_s)) }));
    const { counts } = capture.ledger;
    const lost = NOT_WHOLE.reduce((sum, name) => sum + (counts[name] ?? 0), 0);
    const found = device?.live?.views ? [t("live.perView", { left: device.live.views.left, right: device.live.views.right })] : [];
    setText(fields, [tn("operate.last.fields", capture.fields), lost ? tn("operate.progress.lost", lost) : t("operate.progress.noneLost"), ...found].join(" · "));
    fields.classList.toggle("is-bad", lost > 0);
  }

  const ticking = setInterval(tick, EVERY_MS);
  return {
    element,
    /** @param {Capture} now */
    show(now) {
      capture = now;
      tick();
    },
    unmount: () => clearInterval(ticking),
  };
}
