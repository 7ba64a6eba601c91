// The object as it is now.
import { el, fill, setSymbol, setText, symbol } from "../core/dom.js";
import { MEASURED, openLive } from "./live_source.js";
import { createViewer } from "./viewer.js";

/** @import { Context } from "../core/context.js" */
/** @import { Moment } from "./moments.js" */
/** @import { LiveSource } from "./live_source.js" */

const FRESH_MS = 2000;
const LOOK_EVERY_MS = 1000;
const CALM_MS = 1000;

/** @param {Context} context @param {HTMLElement} body */
export function createLiveView(context, body) {
  const { t, format, store } = context;
  /** @type {(() => void)[]} */
  let ends = [];
  let ended = false;
  const waiting = el("div", { class: "note is-idle" }, symbol("wait"), el("p", {}, t("shape.nothingLive")));

  /** Once something is measured. */
  async function open() {
    const live = await openLive(context).catch(context.refused);
    if (ended || !live) return;
    stopWaiting();
    show(live);
  }

  /** @param {LiveSource} live */
  function show(live) {
    const badge = createBadge(context);
    const viewer = createViewer(context, {
      grid: live.grid, frusta: live.frusta, quantities: MEASURED, file: "live",
      when: (moment) => t("shape.whenLive", { time: format.time(moment.utc ?? 0) }),
    });
    const calm = calmly(viewer.show);
    const end = live.follow((moment) => {
      badge.see(moment);
      calm(moment);
    });
    fill(body, badge.element, viewer.element);
    ends.push(end, viewer.end, badge.end);
  }

  fill(body, waiting);
  const stopWaiting = store.subscribe((known) => known.state?.devices && Boolean(context.device()?.live?.views), (is) => is && setTimeout(open));
  ends.push(stopWaiting);
  return {
    end() {
      ended = true;
      ends.forEach((end) => end());
      ends = [];
    },
  };
}

/** Who wants little motion gets a picture a second. @param {(moment: Moment) => void} show */
function calmly(show) {
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  let last_ms = -Infinity;
  return (/** @type {Moment} */ moment) => {
    const now_ms = performance.now();
    if (still.matches && now_ms - last_ms < CALM_MS) return;
    last_ms = now_ms;
    show(moment);
  };
}

/** Tells whether what is shown is of now. @param {Context} context */
function createBadge({ t, now_ms, format }) {
  const sign = symbol("live");
  const words = el("span", {}, t("shape.live"));
  const element = el("p", { class: "badge is-good", role: "status" }, sign, words);
  let newest_ms = now_ms();
  let utc = "";

  function look() {
    const fresh = now_ms() - newest_ms < FRESH_MS;
    element.className = `badge ${fresh ? "is-good" : "is-warn"}`;
    setSymbol(sign, fresh ? "live" : "warn");
    setText(words, fresh ? t("shape.live") : t("shape.old", { time: utc ? format.time(utc) : "–" }));
  }
  const timer = setInterval(look, LOOK_EVERY_MS);
  return {
    element,
    see(/** @type {Moment} */ moment) {
      newest_ms = now_ms();
      utc = moment.utc ?? "";
      look();
    },
    end: () => clearInterval(timer),
  };
}
