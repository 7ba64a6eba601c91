// The verdict on a calibration, from its report.
import assert from "node:assert/strict";
import { test } from "node:test";
import { judge, sigma } from "../../../src/grabberd/web/static/js/calibration/judge.js";

/** A report that nothing speaks against, with the σ of a plane of the volume: null where a view does not reach. */
function reportOf(sigma_mm) {
  return {
    capture: { fields: 100 },
    identification: { found: { left: 108, right: 108 }, of: 108 },
    result: { sigma0: 1, image_points: 216, unmodelled_px: 0.05, rms_px: {} },
    blunders: [],
    validation: null,
    volume: { planes: [{ total: { x: [sigma_mm], y: [sigma_mm], z: [sigma_mm] } }] },
    warnings: [],
  };
}

test("σ is of the places that both views see, along each axis and of all three together", () => {
  const { typical, worst } = sigma(reportOf([null, null, null, 0.1, 0.2]));
  assert.deepEqual([typical.x, worst.z], [0.2, 0.2]);
  assert.ok(Math.abs(typical.xyz - 0.2 * Math.sqrt(3)) < 1e-12);
});

test("places that no view reaches make no calibration finer", () => {
  const { accept, reasons } = judge(reportOf([null, null, null, 0.2, 0.2]));
  assert.equal(accept, false);
  assert.deepEqual(reasons.map(({ key }) => key), ["coarse"]);
});

test("a calibration is accepted where nothing speaks against it", () => {
  const { accept, reasons } = judge(reportOf([0.02, 0.03, 0.04]));
  assert.equal(accept, true);
  assert.deepEqual(reasons.map(({ key }) => key), ["found", "fine"]);
});

test("a capture of few fields is a reason to look again", () => {
  const { reasons } = judge({ ...reportOf([0.02]), capture: { fields: 3 } });
  assert.deepEqual(reasons, [{ key: "short", values: { n: 3 } }]);
});
