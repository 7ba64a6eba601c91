// A sample of a capture's points: how many there are, and how good.

/** @import { FieldPoints } from "types/documents" */
/** @import { Api } from "types/routes" */

const MOST = 1000;

/**
 * @typedef {object} PointSample
 * @property {number} run
 * @property {number} points of the whole run, estimated from the sample
 * @property {number} targets mean of a field
 * @property {number} residual_px mean
 * @property {number} sigma_mm mean, of all three axes together
 */

/**
 * @param {Api} api
 * @param {string} id of the capture
 * @returns {Promise<PointSample | null>}
 */
export async function sampleOf(api, id) {
  const document = await api.get(`/captures/${encodeURIComponent(id)}/points?max_points=${MOST}`).catch(() => null);
  if (!document?.fields.length) return null;
  const sampled = count(document.fields);
  return {
    run: document.run,
    points: sampled * document.every,
    targets: sampled / document.fields.length,
    residual_px: mean(document.fields, (field, i) => field.residual_px[i]),
    sigma_mm: mean(document.fields, (field, i) => Math.hypot(field.sigma_x_mm[i], field.sigma_y_mm[i], field.sigma_z_mm[i])),
  };
}

/** @param {FieldPoints[]} fields */
const count = (fields) => fields.reduce((sum, field) => sum + field.target.length, 0);

/** @param {FieldPoints[]} fields @param {(field: FieldPoints, i: number) => number} pick */
function mean(fields, pick) {
  const sum = fields.reduce((whole, field) => whole + field.target.reduce((part, _, i) => part + pick(field, i), 0), 0);
  return sum / count(fields);
}
