// Fields of a capture, fetched a stretch at a time: that of the playhead first, then those ahead of it. Those that are
// farthest from it are forgotten, so that a long capture takes no more memory than a short one.
import { statusOf } from "../core/api.js";

const AT_ONCE = 2;
const RETRY_MS = 2000;
/** Without an answer, too busy, given up: all of these pass. */
const PASSES = new Set([0, 429, 503]);

/**
 * @template Field
 * @typedef {object} Stretch
 * @property {Map<number, Field> | null} fields null while they are fetched, and where that failed
 * @property {unknown} problem why it failed
 * @property {number} end number after the last field that was asked for
 * @property {AbortController | null} asked
 */

/**
 * @template Field
 * @typedef {object} Source
 * @property {number} length fields of a stretch
 * @property {number} ahead stretches that are fetched beyond that of the playhead
 * @property {number} kept stretches that are kept at most
 * @property {() => number} total fields that there are
 * @property {(first: number, count: number, signal: AbortSignal) => Promise<Map<number, Field>>} load
 * @property {() => void} changed told when something has come, or failed
 */

/** @template Field @param {Source<Field>} source */
export function createStretches(source) {
  /** @type {Map<number, Stretch<Field>>} */
  const stretches = new Map();
  /** @type {(() => void)[]} */
  let waiters = [];
  /** @type {number[]} */
  let wanted = [];
  let retry = 0;
  let ended = false;

  /** @param {number} n */
  const indexOf = (n) => Math.floor(n / source.length);

  /** Begins to fetch what is needed at a field, and gives up what is not. @param {number} n */
  function want(n) {
    const last = indexOf(Math.max(0, source.total() - 1));
    wanted = Array.from({ length: source.ahead + 1 }, (_, i) => indexOf(n) + i).filter((index) => index <= last);
    for (const [index, one] of stretches) if (one.asked && !wanted.includes(index)) drop(index, one);
    fetchMore();
  }

  /** @param {number} index @param {Stretch<Field>} one */
  function drop(index, one) {
    stretches.delete(index);
    one.asked?.abort();
  }

  function fetchMore() {
    if (ended) return;
    for (const index of wanted) {
      const known = stretches.get(index);
      const end = Math.min((index + 1) * source.length, source.total());
      if (known && (known.asked || known.problem || known.end >= end)) continue;
      if ([...stretches.values()].filter((one) => one.asked).length >= AT_ONCE) return;
      load(index, end);
    }
  }

  /** @param {number} index @param {number} end */
  async function load(index, end) {
    const asked = new AbortController();
    const before = stretches.get(index);
    /** @type {Stretch<Field>} */
    const one = { fields: before?.fields ?? null, problem: null, end, asked };
    stretches.set(index, one);
    const first = index * source.length;
    try {
      one.fields = await source.load(first, end - first, asked.signal);
    } catch (problem) {
      if (asked.signal.aborted) return;
      one.problem = problem;
      if (PASSES.has(statusOf(problem) ?? -1)) retry ||= setTimeout(again, RETRY_MS);
    }
    one.asked = null;
    forget(index);
    fetchMore();
    tell();
  }

  /** What failed for a while is asked for once more. */
  function again() {
    retry = 0;
    for (const [index, one] of stretches) if (one.problem && PASSES.has(statusOf(one.problem) ?? -1)) stretches.delete(index);
    fetchMore();
  }

  /** @param {number} newest */
  function forget(newest) {
    const here = wanted[0] ?? newest;
    const idle = [...stretches].filter(([index, one]) => !one.asked && !wanted.includes(index));
    idle.sort(([a], [b]) => Math.abs(b - here) - Math.abs(a - here));
    for (const [index] of idle.slice(0, Math.max(0, stretches.size - source.kept))) stretches.delete(index);
  }

  function tell() {
    const told = waiters;
    waiters = [];
    for (const one of told) one();
    if (!ended) source.changed();
  }

  /** True once it is known what there is of a field, if only that it cannot be had. @param {number} n */
  function settled(n) {
    const one = stretches.get(indexOf(n));
    return Boolean(one && ((one.fields && n < one.end && !one.asked) || (one.problem && !one.asked) || one.fields?.has(n)));
  }

  return {
    want, settled,
    /** A field; undefined where there is none, or not yet. @param {number} n */
    at: (n) => stretches.get(indexOf(n))?.fields?.get(n),
    /** Why a field cannot be had. @param {number} n @returns {unknown} */
    problemAt: (n) => stretches.get(indexOf(n))?.problem ?? null,
    /** Number of stretches that are held. */
    held: () => stretches.size,
    /** Waits until a field is settled; false if that ended first. @param {number} n */
    async ensure(n) {
      want(n);
      while (!ended && !settled(n)) await new Promise((resolve) => waiters.push(() => resolve(null)));
      return !ended;
    },
    end() {
      ended = true;
      clearTimeout(retry);
      for (const one of stretches.values()) one.asked?.abort();
      stretches.clear();
      tell();
    },
  };
}
