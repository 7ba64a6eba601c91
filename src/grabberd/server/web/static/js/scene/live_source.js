// The points of every field as they are measured, of which as many are shown as can be drawn.
import { measuredMoment } from "./moments.js";
import { frustaOf } from "./frustum.js";
import { gridOf } from "./grid.js";
import { createStream } from "../core/stream.js";
import { columnsOf, PROTOCOL, readPoints } from "../live/points_message.js";

/** @import { Context } from "../core/context.js" */
/** @import { Moment } from "./moments.js" */
/** @import { Frustum } from "./frustum.js" */
/** @import { Grid } from "./grid.js" */
/** @import { Device } from "types/documents" */
/** @import { Api } from "types/routes" */

export const REACH_MM = 120;
const DRAWN_EVERY_MS = 32; // thirty times a second, as near as the fields' rate allows
export const MEASURED = ["displacement_mm", "sigma_mm", "residual_px"];

/**
 * @typedef {object} LiveSource
 * @property {Grid} grid
 * @property {Frustum[]} frusta none without a calibration
 * @property {(show: (moment: Moment) => void) => () => void} follow returns what ends it
 */

/**
 * @param {Context} context
 * @returns {Promise<LiveSource | null>} null: nothing is measured
 */
export async function openLive(context) {
  const { api, store } = context;
  const device = context.device();
  if (!device?.live?.views) return null; // views: it has a calibration and an object model
  const path = /** @type {const} */ (`/devices/${encodeURIComponent(device.name)}`);
  const [object, calibration] = await Promise.all([api.get(`${path}/object`), calibrationOf(api, device)]);
  const grid = gridOf(object);

  /** @param {(moment: Moment) => void} show @returns {() => void} ends it */
  function follow(show) {
    let timer = 0;
    let drawn_ms = -Infinity;
    /** @type {ArrayBuffer | null} */
    let newest = null;

    /** The newest of the fields that came since the last was drawn. */
    function draw() {
      timer = 0;
      const message = newest;
      newest = null;
      if (!message || document.hidden) return;
      drawn_ms = performance.now();
      show(measuredMoment(grid, columnsOf(readPoints(message))));
    }

    /** @param {ArrayBuffer | string} message */
    function take(message) {
      if (typeof message === "string") return; // the description
      newest = message;
      timer ||= setTimeout(draw, Math.max(0, drawn_ms + DRAWN_EVERY_MS - performance.now()));
    }
    const stream = createStream(store, "/api/v1/points/stream", take, { protocols: [PROTOCOL] });
    return () => {
      clearTimeout(timer);
      newest = null;
      stream.end();
    };
  }
  return { grid, frusta: calibration ? frustaOf(calibration, REACH_MM) : [], follow };
}

/** @param {Api} api @param {Device} device */
async function calibrationOf(api, device) {
  return device.calibration ? api.get(`/calibrations/${encodeURIComponent(device.calibration.id)}`) : null;
}
