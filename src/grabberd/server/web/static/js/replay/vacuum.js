// The vacuum beside a capture: as loggers have recorded it, or as its analysis knows it. Nothing here touches the page.
import { column, hasAny } from "../analysis/tables.js";

/** @import { Analysis } from "types/documents" */

/**
 * @typedef {object} Vacuum
 * @property {string[]} names of its curves
 * @property {number[]} time_s from the capture's first field, in order
 * @property {(number | null)[][]} kpa of each curve
 */

const ANALYSED = ["pulsation_vacuum_kpa", "liner_vacuum_kpa"];

/**
 * What loggers have recorded, on the time axis of the one with most readings.
 * @param {{name: string, time_s: number[], kpa: number[]}[]} channels
 * @returns {Vacuum | null} null without any
 */
export function recordedVacuum(channels) {
  const some = channels.filter((one) => one.kpa.length);
  if (!some.length) return null;
  const time_s = some.reduce((most, one) => (one.time_s.length > most.length ? one.time_s : most), some[0].time_s);
  return { names: some.map(({ name }) => name), time_s, kpa: some.map((one) => (one.time_s === time_s ? one.kpa : time_s.map((at) => between(one, at)))) };
}

/** What an analysis was told, field by field. @param {Analysis} document @param {number} field_s from field to field @returns {Vacuum | null} */
export function analysedVacuum({ tables }, field_s) {
  const names = ANALYSED.filter((name) => hasAny(column(tables.fields, name)));
  if (!names.length) return null;
  return { names, time_s: column(tables.fields, "n").map((n) => (n ?? 0) * field_s), kpa: names.map((name) => column(tables.fields, name)) };
}

/** The readings of a window, as columns: times first. @param {Vacuum} vacuum @param {number} first_s @param {number} end_s */
export function windowOf({ time_s, kpa }, first_s, end_s) {
  const [from, to] = [placeIn(time_s, first_s), placeIn(time_s, end_s)];
  return [time_s.slice(from, to), ...kpa.map((values) => values.slice(from, to))];
}

/** @param {{time_s: number[], kpa: number[]}} channel @param {number} at_s */
function between({ time_s, kpa }, at_s) {
  const i = placeIn(time_s, at_s);
  if (i === 0 || i >= time_s.length) return null;
  const share = (at_s - time_s[i - 1]) / (time_s[i] - time_s[i - 1] || 1);
  return kpa[i - 1] + share * (kpa[i] - kpa[i - 1]);
}

/** The first place that is not before a time. @param {number[]} time_s in order @param {number} at_s */
function placeIn(time_s, at_s) {
  let [low, high] = [0, time_s.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (time_s[middle] < at_s) low = middle + 1;
    else high = middle;
  }
  return low;
}
