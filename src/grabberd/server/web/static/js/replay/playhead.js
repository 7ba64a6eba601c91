// The playhead: which field is shown, and which comes next. All panes follow it.
/** As fast as it was, and slower. */
export const SPEEDS = [1, 0.5, 0.25, 0.1];
/** A page that was held up for longer goes on where it stood. */
const LONGEST_S = 0.25;

/**
 * Where a playhead stands later, in fields; at the end of its range it begins again.
 * @param {number} at in fields
 * @param {number} passed_s
 * @param {number} speed 1: as fast as it was
 * @param {[number, number]} range first field, and the one after the last
 * @param {number} field_s from field to field
 */
export function advanced(at, passed_s, speed, [first, end], field_s) {
  const length = Math.max(1, end - first);
  const from = at >= first && at < end ? at : first;
  return first + ((from - first + (passed_s * speed) / field_s) % length);
}

/**
 * @param {object} about
 * @param {number} about.field_s from field to field
 * @param {() => number} about.total number of fields
 * @param {(n: number) => boolean} about.ready whether a field can be shown
 * @param {(n: number) => void} about.moved
 * @param {() => void} about.changed it plays, waits or loops, or does no longer
 */
export function createPlayhead({ field_s, total, ready, moved, changed }) {
  let at = 0;
  let n = -1;
  let playing = false;
  let waiting = false;
  let speed = 1;
  /** @type {[number, number] | null} */
  let loop = null;
  let last_ms = 0;
  let turn = 0;

  const range = () => loop ?? /** @type {[number, number]} */ ([0, total()]);

  /** @param {number} now_ms */
  function next(now_ms) {
    const passed_s = Math.min(Math.max(0, now_ms - last_ms) / 1000, LONGEST_S);
    last_ms = now_ms;
    const later = advanced(at, passed_s, speed, range(), field_s);
    const waits = !ready(Math.floor(later));
    if (!waits) at = later;
    stand(Math.floor(waits ? later : at), waits);
    turn = requestAnimationFrame(next);
  }

  /** Tells where it is; while it waits it stays where it was, but asks for what comes. @param {number} to @param {boolean} waits */
  function stand(to, waits) {
    if (waits !== waiting) {
      waiting = waits;
      changed();
    }
    if (waits || to === n) return;
    n = to;
    moved(n);
  }

  /** @param {boolean} on */
  function play(on) {
    if (on === playing) return;
    playing = on;
    waiting = false;
    cancelAnimationFrame(turn);
    last_ms = performance.now();
    if (on) turn = requestAnimationFrame(next);
    changed();
  }

  return {
    play,
    /** Goes to a field, and stays there. @param {number} to */
    go(to) {
      const [first, end] = [0, Math.max(1, total())];
      at = Math.min(Math.max(Math.round(to), first), end - 1);
      if (loop && (at < loop[0] || at >= loop[1])) this.loop(null);
      if (at === n) return;
      n = at;
      moved(n);
    },
    /** @param {[number, number] | null} fields */
    loop(fields) {
      loop = fields;
      changed();
    },
    /** @param {number} to */
    pace(to) {
      speed = to;
    },
    now: () => ({ n: Math.max(0, n), playing, waiting, speed, loop }),
    end: () => cancelAnimationFrame(turn),
  };
}
