// What speaks for a calibration, from its report.
import assert from "node:assert/strict";
import { test } from "node:test";
import { inFavour, lengthsOf, scaleOf, sigma } from "../../../../src/grabberd/server/web/static/js/calibration/judge.js";

/** A report that nothing speaks against, with the σ of a plane of the volume: null where a view does not reach. */
function reportOf(sigma_mm) {
  return {
    capture: { fields: 100 },
    identification: { found: { left: 108, right: 108 }, of: 108 },
    result: { sigma0: 1, image_points: 216, unmodelled_px: 0.05, rms_px: {} },
    blunders: [],
    validation: null,
    volume: { planes: [{ total: { x: [sigma_mm], y: [sigma_mm], z: [sigma_mm] } }] },
  };
}

test("σ is of the places that both views see, along each axis and of all three together", () => {
  const { typical, worst } = sigma(reportOf([null, null, null, 0.1, 0.2]));
  assert.deepEqual([typical.x, worst.z], [0.2, 0.2]);
  assert.ok(Math.abs(typical.xyz - 0.2 * Math.sqrt(3)) < 1e-12);
});

test("what speaks for a calibration is what was found and how fine it is, without places that no view reaches", () => {
  const said = inFavour(reportOf([null, null, null, 0.03, 0.04]));
  assert.deepEqual(said.map(({ key }) => key), ["found", "fine"]);
  assert.ok(Math.abs(said[1].values.mm - 0.04 * Math.sqrt(3)) < 1e-12);
});

test("targets that were held out are said to be met where some were", () => {
  const validated = { ...reportOf([0.02]), validation: { rmse_mm: { xyz: 0.05 } } };
  assert.deepEqual(inFavour(validated).map(({ key }) => key), ["found", "fine", "met"]);
});

/** A view of two by two nodes, one of them outside of the calibration frame's volume and one not seen. */
const VIEW = { inside: [[true, true], [false, true]] };

test("σ of a point is that of its axes together, and none where one is not known", () => {
  assert.deepEqual(lengthsOf({ x: [[3, 0]], y: [[4, null]], z: [[0, 1]] }), [[5, NaN]]);
});

test("colours go from the least σ to four times what is usual in the calibration frame's volume", () => {
  const scale = scaleOf([VIEW], [[[1, 2], [100, NaN]]]);
  assert.deepEqual([scale.low, scale.high], [1, 8]);
  assert.equal(scaleOf([VIEW], [[[NaN, NaN], [NaN, NaN]]]), null);
});

test("where only what lies outside of the volume is seen, the colours are of that", () => {
  assert.equal(scaleOf([VIEW], [[[NaN, NaN], [2, NaN]]]).low, 2);
});
