// A sample of a capture's points: how many there are, and how good.

const MOST = 1000;

/**
 * @param {any} api
 * @param {string} id of the capture
 * @returns {Promise<{run: number, points: number, targets: number, residual_px: number, sigma_mm: number} | null>} `points` is estimated from the sample
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

/** @param {any[]} fields */
const count = (fields) => fields.reduce((sum, field) => sum + field.target.length, 0);

/** @param {any[]} fields @param {(field: any, i: number) => number} pick */
function mean(fields, pick) {
  const sum = fields.reduce((whole, field) => whole + field.target.reduce((/** @type {number} */ part, /** @type {number} */ _, /** @type {number} */ i) => part + pick(field, i), 0), 0);
  return sum / count(fields);
}
