// A light's word in full, with its numbers as people read them.

/** @param {import("../core/context.js").Context} context @param {import("./judge.js").Light} light */
export function wordsOf({ t, tn, format }, light) {
  const values = light.values ?? {};
  const key = `lights.${light.id}.words.${light.word}`;
  if (light.id === "lost" && light.word === "some") return tn("lights.lost.words.some", values.n);
  if (light.id === "calibration" && light.word === "good") return `${t(key, values)} · ${age(values.days, tn)}`;
  return t(key, shown(values, format));
}

/** @param {any} values @param {any} format */
function shown(values, format) {
  const { hz, wanted, minutes, seconds } = values;
  return {
    ...values,
    hz: format.number(hz, 1),
    wanted: format.number(wanted),
    left: minutes === undefined ? "" : format.duration(minutes * 60),
    off: seconds === undefined ? "" : format.duration(seconds),
  };
}

/** @param {number} days @param {(key: string, n: number) => string} tn */
function age(days, tn) {
  return tn("lights.calibration.age", Math.floor(days));
}
