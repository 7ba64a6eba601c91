// From where the object is looked at. In the object's frame +X runs down the picture, +Y to the right, +Z toward
// the cameras; so X is the axis that everything turns about.

/** @typedef {[number, number, number]} Place */

/**
 * @typedef {object} Orbit
 * @property {number} azimuth_deg round the X axis, from +Z toward +Y
 * @property {number} elevation_deg above the horizon, toward −X
 * @property {number} zoom 1: the whole object fills the picture
 * @property {[number, number]} shift of the picture's middle to the right and up, in radii of the object
 */

/** @type {Record<string, Orbit>} */
export const VIEWS = {
  front: { azimuth_deg: 0, elevation_deg: 0, zoom: 1, shift: [0, 0] },
  side: { azimuth_deg: 90, elevation_deg: 0, zoom: 1, shift: [0, 0] },
  top: { azimuth_deg: 0, elevation_deg: 90, zoom: 1, shift: [0, 0] },
  oblique: { azimuth_deg: 38, elevation_deg: 22, zoom: 1, shift: [0, 0] },
};
const MOST_ZOOM = 12;
const LEAST_ZOOM = 0.2;
const MARGIN = 0.9;
/** Sine of half the angle of view: by this much a place nearer than the middle looks larger. */
const PERSPECTIVE = 0.26;

/** @param {Orbit} orbit @param {number} right_deg @param {number} up_deg @returns {Orbit} */
export function turned(orbit, right_deg, up_deg) {
  const elevation_deg = Math.min(90, Math.max(-90, orbit.elevation_deg + up_deg));
  return { ...orbit, azimuth_deg: ((orbit.azimuth_deg + right_deg + 540) % 360) - 180, elevation_deg };
}

/** @param {Orbit} orbit @param {number} factor @returns {Orbit} */
export function zoomed(orbit, factor) {
  return { ...orbit, zoom: Math.min(MOST_ZOOM, Math.max(LEAST_ZOOM, orbit.zoom * factor)) };
}

/** @param {Orbit} orbit @param {number} right @param {number} up in radii @returns {Orbit} */
export function shifted(orbit, right, up) {
  return { ...orbit, shift: [orbit.shift[0] + right, orbit.shift[1] + up] };
}

/**
 * The picture's axes in the object's frame, orthonormal and right-handed: to the right, up, and toward the eye.
 * @param {Orbit} orbit
 */
export function axesOf({ azimuth_deg, elevation_deg }) {
  const [a, e] = [azimuth_deg, elevation_deg].map((deg) => (deg * Math.PI) / 180);
  return {
    right: /** @type {Place} */ ([0, Math.cos(a), -Math.sin(a)]),
    up: /** @type {Place} */ ([-Math.cos(e), -Math.sin(e) * Math.sin(a), -Math.sin(e) * Math.cos(a)]),
    back: /** @type {Place} */ ([-Math.sin(e), Math.cos(e) * Math.sin(a), Math.cos(e) * Math.cos(a)]),
  };
}

/**
 * Position of the eye and of the place it looks at.
 * @param {Orbit} orbit
 * @param {{middle: Place, radius: number}} object in mm
 * @param {number} fov_deg the picture's lesser angle of view
 */
export function eyeOf(orbit, object, fov_deg) {
  const { right, up, back } = axesOf(orbit);
  const distance = object.radius / Math.sin((fov_deg * Math.PI) / 360) / orbit.zoom;
  const [x, y] = orbit.shift.map((part) => part * object.radius);
  const target = place((i) => object.middle[i] - x * right[i] - y * up[i]);
  return { up, target, distance, eye: place((i) => target[i] + distance * back[i]) };
}

/** @param {(axis: number) => number} part @returns {Place} */
const place = (part) => [part(0), part(1), part(2)];

/**
 * The same direction, so near that all places just fit into the picture.
 * @param {Orbit} orbit
 * @param {ArrayLike<number>} xyz
 * @param {{middle: Place, radius: number}} object what the orbit is about
 * @param {number} aspect width by height
 * @returns {Orbit}
 */
export function fitted(orbit, xyz, object, aspect) {
  const { right, up, back } = axesOf(orbit);
  const reach = (/** @type {Place} */ axis) => greatest(xyz, (/** @type {number} */ i) => Math.abs(along(xyz, i, object.middle, axis)));
  const beside = (object.radius * Math.max(1, aspect)) / Math.max(reach(right), 1);
  const above = (object.radius * Math.max(1, 1 / aspect)) / Math.max(reach(up), 1);
  const zoom = MARGIN * Math.min(beside, above);
  const nearer = 1 / (1 + (PERSPECTIVE * zoom * reach(back)) / object.radius);
  return { ...orbit, zoom: zoom * nearer, shift: [0, 0] };
}

/** @param {ArrayLike<number>} xyz @param {(i: number) => number} value */
function greatest(xyz, value) {
  let most = 0;
  for (let i = 0; i < xyz.length; i += 3) if (Number.isFinite(xyz[i])) most = Math.max(most, value(i));
  return most;
}

/** @param {ArrayLike<number>} xyz @param {number} i @param {Place} middle @param {Place} axis */
function along(xyz, i, middle, axis) {
  return (xyz[i] - middle[0]) * axis[0] + (xyz[i + 1] - middle[1]) * axis[1] + (xyz[i + 2] - middle[2]) * axis[2];
}

/** The ball round all places that are known. @param {ArrayLike<number>} xyz @returns {{middle: Place, radius: number}} */
export function ballRound(xyz) {
  const axis = (/** @type {number} */ i) => Array.from(xyz).filter((value, k) => k % 3 === i && Number.isFinite(value));
  const spans = [0, 1, 2].map((i) => axis(i)).map((all) => [Math.min(...all), Math.max(...all)]);
  const middle = /** @type {Place} */ (spans.map(([low, high]) => (Number.isFinite(low) ? (low + high) / 2 : 0)));
  const radius = Math.hypot(...spans.map(([low, high]) => (Number.isFinite(low) ? (high - low) / 2 : 0)));
  return { middle, radius: radius || 1 };
}
