// The newest points, requested again when an event tells of a new field.
import { measuredMoment } from "./moments.js";
import { frustaOf } from "./frustum.js";
import { gridOf } from "./grid.js";
import { deviceOf } from "../core/store.js";

/** @import { Context } from "../core/context.js" */
/** @import { Moment } from "./moments.js" */
/** @import { Frustum } from "./frustum.js" */
/** @import { Grid } from "./grid.js" */
/** @import { Device } from "types/documents" */
/** @import { Api } from "types/routes" */

export const REACH_MM = 120;
export const MEASURED = ["displacement_mm", "sigma_mm", "residual_px"];

/**
 * @typedef {object} LiveSource
 * @property {Grid} grid
 * @property {Frustum[]} frusta none without a calibration
 * @property {(show: (moment: Moment) => void, failed: (problem: unknown) => void) => () => void} follow returns what ends it
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

  /** @param {(moment: Moment) => void} show @param {(problem: unknown) => void} failed @returns {() => void} ends it */
  function follow(show, failed) {
    let busy = false;
    let ended = false;

    async function look() {
      if (busy || document.hidden) return;
      busy = true;
      try {
        const points = await api.get(`${path}/points`);
        if (!ended) show(measuredMoment(grid, points));
      } catch (problem) {
        if (!ended) failed(problem);
      } finally {
        busy = false;
      }
    }
    const end = store.subscribe((known) => deviceOf(known)?.live?.n, look);
    return () => {
      ended = true;
      end();
    };
  }
  return { grid, frusta: calibration ? frustaOf(calibration, REACH_MM) : [], follow };
}

/** @param {Api} api @param {Device} device */
async function calibrationOf(api, device) {
  return device.calibration ? api.get(`/calibrations/${encodeURIComponent(device.calibration.id)}`) : null;
}
