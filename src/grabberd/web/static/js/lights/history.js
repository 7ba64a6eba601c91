// Fields lost in the last minute, from the counters of the state.

/** @import { Device } from "types/documents" */

const KEPT_MS = 60_000;
const LOSSES = ["lost", "damaged", "overrun"];

/** @typedef {{at: number, lost: number, all: number}} Mark */

/** @typedef {ReturnType<typeof createHistory>} LossHistory */

export function createHistory() {
  /** @type {Mark[]} */
  let marks = [];

  /** The counters at a moment; a daemon that has begun anew counts from nothing. @param {Device["fields"]} fields @param {number} at by Date.now() */
  function enter(fields, at) {
    const lost = LOSSES.reduce((sum, name) => sum + fields[name], 0);
    const mark = { at, lost, all: lost + fields.received + fields.no_signal };
    if (marks.length && mark.all < marks[marks.length - 1].all) marks = [];
    marks.push(mark);
    marks = marks.filter((one) => at - one.at <= KEPT_MS);
  }

  /** Of the last minute: how many were lost, and of how many. */
  function losses() {
    const [first, last] = [marks[0], marks[marks.length - 1]];
    return first ? { lost: last.lost - first.lost, all: last.all - first.all } : { lost: 0, all: 0 };
  }

  return { enter, losses };
}
