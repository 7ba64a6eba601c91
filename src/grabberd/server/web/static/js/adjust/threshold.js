// The threshold: chosen by the instrument, or set by hand.
import { el, setText } from "../core/dom.js";
import { deviceOf } from "../core/store.js";

/** @import { Context } from "../core/context.js" */
/** @import { Settings, Threshold } from "types/documents" */

const SETTLE_MS = 250;

/** @param {Context} context */
export function createThreshold(context) {
  const { t, api, store, may, refused } = context;
  const automatic = el("input", { type: "checkbox", id: "automatic", on: { change: () => set(automatic.checked ? null : Number(slider.value)) } });
  const slider = el("input", { class: "slider", type: "range", id: "threshold", min: 0, max: 254, step: 1, on: { input: moved } });
  const value = el("output", { class: "number", for: "threshold" });
  const why = el("p", { class: "field-hint", id: "threshold-why" });
  const element = el("div", { class: "field" },
    el("div", { class: "row between" }, el("label", { class: "field-label", for: "threshold" }, t("live.aid.threshold"), " ", value),
      el("label", { class: "check" }, automatic, t("live.aid.automatic"))),
    slider, why);
  let timer = 0;
  let busy = false;

  function moved() {
    setText(value, slider.value);
    automatic.checked = false;
    busy = true;
    clearTimeout(timer);
    timer = setTimeout(() => set(Number(slider.value)), SETTLE_MS);
  }

  /** @param {number | null} level null: as it is configured */
  async function set(level) {
    busy = true;
    /** @type {Threshold} */
    const threshold = level === null ? { kind: "automatic" } : { kind: "fixed", value: level };
    try {
      take(await api.put("/settings", { body: { device: context.device()?.name, threshold } }));
    } catch (problem) {
      refused(problem);
      await look();
    }
    busy = false;
  }

  async function look() {
    take(await api.get("/settings").catch(() => null));
  }

  /** @param {Settings | null} settings */
  function take(settings) {
    const own = settings?.devices[context.device()?.name ?? ""];
    if (own) automatic.checked = own.threshold.kind !== "fixed";
  }

  function enable() {
    const isCapturing = Boolean(context.device()?.capture_id);
    slider.disabled = automatic.disabled = !may("operator") || isCapturing;
    setText(why, isCapturing ? t("live.aid.held") : may("operator") ? "" : t("live.aid.viewer"));
  }

  const end = store.subscribe((known) => deviceOf(known)?.capture_id, enable);
  look();
  return {
    element,
    /** The one in force. @param {number} level */
    show(level) {
      if (busy) return;
      slider.value = String(level);
      setText(value, String(level));
    },
    unmount() {
      end();
      clearTimeout(timer);
    },
  };
}
