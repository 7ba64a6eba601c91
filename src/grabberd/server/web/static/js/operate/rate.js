// Pulsations a minute, for a length in pulsations: as entered here, else as measured last; and which of these it is.
import { el, setText } from "../core/dom.js";
import { createNumberField } from "../core/number_field.js";
import { deviceOf } from "../core/store.js";
import { USUAL } from "./wish.js";

/** @import { Context } from "../core/context.js" */
/** @import { Change, Wish } from "./wish.js" */
/** @import { Pulsation } from "types/documents" */

const DIGITS = 1;
const LEAST = 1;

/**
 * @param {Context} context
 * @param {Wish} wish
 * @param {Change} set
 * @param {() => void} changed it is another one than before
 */
export function createRate(context, wish, set, changed) {
  const { t, api, store, format } = context;
  const attributes = { class: "input number", id: "length-rate", "aria-describedby": "length-rate-from" };
  const own = createNumberField(context, attributes, (n) => set("ownPerMinute", n), () => ({ least: LEAST }));
  const from = el("span", { class: "field-hint", id: "length-rate-from" });
  const element = el("label", { class: "field", for: "length-rate" }, el("span", { class: "field-label" }, t("operate.length.rate")), own.input, own.problem, from);
  /** @type {Pulsation | null} */
  let measured = null;
  let asked = "";
  let ended = false;
  own.input.addEventListener("blur", show);

  /** Asks for the rate in the device's newest analysis. @param {string} device */
  async function ask(device) {
    asked = device;
    measured = null;
    const found = await api.get(`/devices/${encodeURIComponent(device)}/pulsation`).catch(() => null);
    if (ended || asked !== device || !found?.rate_per_min) return;
    measured = found;
    show();
    changed();
  }

  const value = () => wish.ownPerMinute ?? measured?.rate_per_min ?? USUAL.perMinute;

  function show() {
    element.hidden = wish.kind !== "cycles";
    const device = deviceOf(store.get())?.name;
    if (!element.hidden && device && device !== asked) ask(device);
    own.show(value(), wish.ownPerMinute === null && measured ? value().toFixed(DIGITS) : undefined);
    setText(from, words());
  }

  function words() {
    if (wish.ownPerMinute !== null) return measured ? t("operate.length.rateOwnMeasured", { rate: format.number(measured.rate_per_min, DIGITS) }) : t("operate.length.rateOwn");
    return measured ? t("operate.length.rateMeasured", { id: measured.capture }) : t("operate.length.rateUsual");
  }

  const end = store.subscribe((known) => deviceOf(known)?.name, show);
  return {
    element, value, show,
    unmount() {
      ended = true;
      end();
    },
  };
}
