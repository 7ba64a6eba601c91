// Veil over a live picture that is not of now, with the reason.
import { el, setText } from "../core/dom.js";
import { deviceOf, streams } from "../core/store.js";

/** @import { Context } from "../core/context.js" */
/** @import { Preview } from "./message.js" */

const OLD_MS = 1000;
const LOOK_MS = 250;
/** By so much the least delay may grow a second: two clocks do not go quite alike. */
const DRIFT_MS = 0.1;

/** @param {Context} context */
export function createVeil({ t, store, format }) {
  const element = el("p", { class: "veil", hidden: true });
  let held = false;
  let taken_ms = 0;
  let arrived = performance.now();
  /** Of the pictures that came, the least time between exposure here and there: the clocks' difference, and more. */
  let least_ms = Infinity;
  /** @type {Preview | null} */
  let newest = null;

  /** Age of the newest picture: since it came, and what it was later than others before it came. */
  function age_ms() {
    const late_ms = newest ? arrived - taken_ms - least_ms : 0;
    return performance.now() - arrived + late_ms;
  }

  function look() {
    const word = held ? null : reason();
    element.hidden = word === null;
    if (word !== null) setText(element, word);
    least_ms += DRIFT_MS * (LOOK_MS / 1000);
  }

  /** Why what is shown is not of now; null if it is. */
  function reason() {
    const device = deviceOf(store.get());
    const state = device?.state;
    const current = age_ms() <= OLD_MS;
    if (current && newest && newest.outcome !== "no_signal") return null;
    if (!store.get().connection.online) return old("live.veil.away");
    if (state === "no_signal" || (newest?.outcome === "no_signal" && current)) return t("live.noPicture");
    if (state && !streams(device)) return old(`live.veil.${state}`);
    return newest ? old("live.veil.old") : current ? null : t("live.veil.none");
  }

  /** With the time that the picture is of. @param {string} key */
  function old(key) {
    return newest?.rows ? `${t(key)} ${t("live.veil.of", { time: format.time(taken_ms) })}` : t(key);
  }

  const ticking = setInterval(look, LOOK_MS);
  return {
    element,
    /** @param {Preview} preview */
    came(preview) {
      newest = preview;
      taken_ms = preview.time_ms;
      arrived = performance.now();
      least_ms = Math.min(least_ms, arrived - taken_ms);
      look();
    },
    /** A picture that is frozen on purpose has no veil. @param {boolean} on */
    hold(on) {
      held = on;
      look();
    },
    unmount: () => clearInterval(ticking),
  };
}
