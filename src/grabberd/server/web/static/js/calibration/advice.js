// Advice on lamp, lens and calibration frame, from the light in each view. Nothing here touches the page.

/** @import { Illumination, ViewIllumination } from "types/documents" */

const ENOUGH = 0.9;
const MANY = 1.15;
const CLIPPED = 0.5;
const SMALL_PX = 3;
const LARGE_PX = 16;
const CONTRAST = 60;

/** @typedef {{key: string, view: string}} Advice key of calibration.advice */

/** @param {Illumination} light of the API @param {number} of how many targets the calibration frame has @returns {Advice[]} */
export function adviceFor(light, of) {
  return Object.entries(light.views).flatMap(([view, shown]) => keysFor(shown, of).map((key) => ({ key, view })));
}

/** @param {ViewIllumination} shown @param {number} of */
function keysFor(shown, of) {
  const keys = [];
  if (shown.targets === 0) return ["dark"];
  if (shown.targets < ENOUGH * of) keys.push("few");
  if (shown.targets > MANY * of) keys.push("many");
  if (shown.clipped > CLIPPED) keys.push("bright");
  else if (shown.brightest - shown.background < CONTRAST) keys.push("weak");
  if (shown.diameter_px !== null && shown.diameter_px < SMALL_PX) keys.push("small");
  if (shown.diameter_px !== null && shown.diameter_px > LARGE_PX) keys.push("large");
  return keys;
}

/** True if a view shows enough targets, and not many more than there are. @param {ViewIllumination} shown @param {number} of */
export function isEnough(shown, of) {
  return shown.targets >= ENOUGH * of && shown.targets <= MANY * of;
}
