// From where the object is looked at, and where the virtual cameras look.
import assert from "node:assert/strict";
import { test } from "node:test";
import { rayOf, rotation } from "../../../../src/grabberd/server/web/static/js/scene/frustum.js";
import { axesOf, ballRound, eyeOf, fitted, turned, VIEWS, zoomed } from "../../../../src/grabberd/server/web/static/js/scene/orbit.js";
import { cross } from "../../../../src/grabberd/server/web/static/js/scene/mesh.js";

const near = (one, other, within = 1e-9) => one.forEach((part, i) => assert.ok(Math.abs(part - other[i]) < within, `${one} is not ${other}`));
const dot = (a, b) => a.reduce((sum, part, i) => sum + part * b[i], 0);

test("from the front X runs down, Y to the right, and the cameras' side is nearer", () => {
  const { right, up, back } = axesOf(VIEWS.front);
  near(right, [0, 1, 0]);
  near(up, [-1, 0, 0]);
  near(back, [0, 0, 1]);
});

test("from the side the liner still stands upright; from the top one looks along it", () => {
  near(axesOf(VIEWS.side).up, [-1, 0, 0]);
  near(axesOf(VIEWS.side).back, [0, 1, 0]);
  near(axesOf(VIEWS.top).back, [-1, 0, 0]);
  near(axesOf(VIEWS.top).right, [0, 1, 0]);
});

test("the picture's axes are orthonormal and right-handed from everywhere", () => {
  for (const [azimuth_deg, elevation_deg] of [[0, 0], [38, 22], [-120, -80], [179, 90]]) {
    const { right, up, back } = axesOf({ ...VIEWS.front, azimuth_deg, elevation_deg });
    near(cross(right, up), back);
    for (const axis of [right, up, back]) assert.ok(Math.abs(dot(axis, axis) - 1) < 1e-12);
  }
});

test("turning goes round and stops at the poles, zooming stops too", () => {
  assert.equal(turned(VIEWS.front, 370, 0).azimuth_deg, 10);
  assert.equal(turned(VIEWS.front, -190, 0).azimuth_deg, 170);
  assert.equal(turned(VIEWS.front, 0, 500).elevation_deg, 90);
  assert.ok(zoomed(VIEWS.front, 1e9).zoom < 100);
});

test("the eye looks at the object's middle from its distance", () => {
  const object = { middle: [1, 2, 3], radius: 50 };
  const { eye, target, distance } = eyeOf(VIEWS.front, object, 30);
  near(target, object.middle);
  near(eye, [1, 2, 3 + distance]);
  assert.ok(distance > object.radius);
});

test("a fitted view fills the picture, and a longer one is farther away", () => {
  const long = [-60, -13, 0, 60, 13, 0];
  const object = ballRound(long);
  const [wide, tall] = [fitted(VIEWS.front, long, object, 1.5), fitted(VIEWS.front, long, object, 0.6)];
  assert.ok(tall.zoom > wide.zoom);
  assert.ok(fitted(VIEWS.top, long, object, 1.5).zoom > wide.zoom);
});

test("the ball round an object passes over what was not seen", () => {
  const { middle, radius } = ballRound([-3, 0, 0, 5, 0, 0, NaN, NaN, NaN]);
  near(middle, [1, 0, 0]);
  assert.equal(radius, 4);
});

test("a rotation is orthogonal", () => {
  const R = rotation(0.4, -0.2, 1.5);
  for (const i of [0, 1, 2]) for (const j of [0, 1, 2]) assert.ok(Math.abs(dot(R[i], R[j]) - (i === j ? 1 : 0)) < 1e-12);
});

test("a camera without rotation looks along −z, and its pixels' lines run down", () => {
  const view = { x0_px: 360, y0_px: 288, pixel_x_mm: 0.01, pixel_y_mm: 0.01, f_mm: 8, handedness: 1, omega_rad: 0, phi_rad: 0, kappa_rad: 0 };
  near(rayOf(view, 360, 288), [0, 0, -1]);
  near(rayOf(view, 1160, 288), [1, 0, -1]);
  near(rayOf(view, 360, 1088), [0, -1, -1]);
});
