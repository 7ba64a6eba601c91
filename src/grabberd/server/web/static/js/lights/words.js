// A light's word in full, with its numbers as people read them; the daemon's causes in words.

/** @import { Context } from "../core/context.js" */
/** @import { Format } from "../core/format.js" */
/** @import { Light, LightValues } from "./judge.js" */

/** True if there are texts for a cause of the daemon. @param {Context} context @param {string | null | undefined} code */
export function isKnown({ texts }, code) {
  return Boolean(code) && texts.has(`causes.${code}.what`);
}

/** A lack in words: the page's own, or the daemon's where the page has none. @param {Context} context @param {{cause_code: string | null, message: string}} lack */
export function lackIn(context, lack) {
  return isKnown(context, lack.cause_code) ? context.t(`causes.${lack.cause_code}.what`) : lack.message;
}

/** @param {Context} context @param {Light} light */
export function wordsOf({ t, tn, format }, light) {
  const values = light.values ?? {};
  const key = `lights.${light.id}.words.${light.word}`;
  if (values.n !== undefined) return tn(key, values.n);
  if (light.word === "good" && values.days !== undefined) return `${t(key, values)} · ${age(values.days, tn)}`;
  return t(key, shown(values, format));
}

/** @param {LightValues} values @param {Format} format */
function shown(values, format) {
  const { hz, wanted, minutes, seconds, points } = values;
  return {
    ...values,
    hz: format.number(hz, 1),
    wanted: format.number(wanted),
    points: format.number(points),
    left: minutes === undefined ? "" : format.duration(minutes * 60),
    off: seconds === undefined ? "" : format.duration(seconds),
  };
}

/** @param {number} days @param {(key: string, n: number) => string} tn */
function age(days, tn) {
  return tn("lights.calibration.age", Math.floor(days));
}
