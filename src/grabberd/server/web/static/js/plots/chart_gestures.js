// What the gestures do to a chart: they move its cursor and its range.
import { between, shareIn, zoomedAbout } from "./range.js";

/** @import uPlot from "../../vendor/uplot/uPlot.esm.js" */
/** @import { Gestures } from "./gestures.js" */
/** @import { Link } from "./link.js" */
/** @import { Range } from "./range.js" */
/** @import { Column } from "./series.js" */

/**
 * @param {object} chart
 * @param {Link} chart.link
 * @param {() => uPlot | null} chart.plot
 * @param {() => Column} chart.places its samples along x
 * @param {() => Range} chart.shown
 * @param {(wanted: Range | null) => void} chart.zoom
 * @param {(x: number) => void} chart.pressed
 * @returns {Gestures}
 */
export function gesturesOf({ link, plot, places, shown, zoom, pressed }) {
  /** The sample nearest to a share of the width. @param {number} share */
  function sampleAt(share) {
    const [x] = between(shown(), share, share);
    return places()[plot()?.valToIdx(x) ?? -1] ?? null;
  }

  return {
    isWhole: () => link.get().range === null,
    zoom: (at, factor) => zoom(zoomedAbout(shown(), Number.isFinite(at) ? at : shareIn(shown(), link.get().cursor), factor)),
    shift: (by) => void (link.get().range && zoom(between(shown(), by, 1 + by))),
    sweep(from, to, ended) {
      const drawn = plot();
      if (!drawn) return;
      const wide = drawn.over.clientWidth;
      drawn.setSelect({ left: Math.min(from, to) * wide, width: ended ? 0 : Math.abs(to - from) * wide, top: 0, height: drawn.over.clientHeight }, false);
      if (ended && from !== to) zoom(between(shown(), from, to));
    },
    read: (at) => link.set({ cursor: sampleAt(at) }),
    tap(at) {
      const cursor = sampleAt(at);
      link.set({ cursor });
      if (cursor !== null) pressed(cursor);
    },
    reset: () => zoom(null),
    step(samples) {
      const all = places();
      const { cursor, mark } = link.get();
      const at = cursor ?? mark;
      const index = at === null ? all.length - 1 : (plot()?.valToIdx(at) ?? 0) + samples;
      link.set({ cursor: all[Math.min(Math.max(index, 0), all.length - 1)] ?? null });
    },
  };
}
