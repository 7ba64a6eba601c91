// The canvas that the object is drawn on. Nothing is drawn unless it is asked for.
import { Camera, Renderer, Transform } from "../../vendor/ogl/ogl.js";
import { MAPS } from "./colours.js";
import { createLines, createPoints, createSurface } from "./layers.js";
import { normalsOf, trianglesOf, wireOf } from "./mesh.js";
import { eyeOf } from "./orbit.js";

/** @import { Rgb } from "./colours.js" */
/** @import { Frustum } from "./frustum.js" */
/** @import { Grid } from "./grid.js" */
/** @import { Orbit } from "./orbit.js" */

/** @typedef {ReturnType<typeof createStage>} Stage */

/**
 * @typedef {object} Shown
 * @property {Float32Array} xyz_mm of the targets, NaN where one was not seen
 * @property {Float32Array} shares of the colour scale, −1 without a value, −2 where none is wanted
 * @property {keyof typeof MAPS} map
 * @property {{points: boolean, wire: boolean, surface: boolean}} parts
 * @property {Frustum[]} frusta the cameras; none where they are not to be seen
 * @property {Orbit} orbit
 * @property {{middle: [number, number, number], radius: number}} object what fills the picture
 * @property {ArrayLike<number> | null} marked_mm where the chosen target is
 * @property {Record<"wire" | "wireOn" | "plain" | "unknown" | "camera" | "rim", Rgb>} colours wireOn: a wire before the surface
 */

export const FOV_DEG = 30;
const TARGET_MM = 1.5;
const LEAST_PIXELS = 9;

/** True if this browser can draw at all. */
export function canDraw() {
  const context = document.createElement("canvas").getContext("webgl2");
  context?.getExtension("WEBGL_lose_context")?.loseContext(); // browsers have few: this one is given back at once
  return context !== null;
}

/** @param {HTMLCanvasElement} canvas @param {Grid} grid */
export function createStage(canvas, grid) {
  const dpr = Math.min(window.devicePixelRatio || 1, 2);
  const renderer = new Renderer({ canvas, dpr, alpha: true, premultipliedAlpha: true, antialias: true });
  const gl = renderer.gl;
  const colours = { uMap: { value: MAPS.rising }, uPlain: { value: [1, 1, 1] }, uUnknown: { value: [0.5, 0.5, 0.5] } };
  const layers = {
    surface: createSurface(gl, 2 * grid.cells.length, colours),
    wire: createLines(gl, grid.edges.length, 1.6),
    points: createPoints(gl, grid.target.length, colours),
    cameras: createLines(gl, 16, 2),
  };
  const scene = new Transform();
  for (const layer of Object.values(layers)) layer.mesh.setParent(scene);
  const camera = new Camera(gl, { fov: FOV_DEG, near: 1, far: 10000 });
  let size = { width: 1, height: 1 };

  /** @param {number} width in CSS pixels @param {number} height */
  function resize(width, height) {
    size = { width: Math.max(1, width), height: Math.max(1, height) };
    renderer.setSize(size.width, size.height);
    leaveSizeToStyleSheet();
  }

  /** The renderer writes its own size, 300 pixels at first, onto the canvas, which is then wider than a small phone. */
  function leaveSizeToStyleSheet() {
    canvas.style.width = canvas.style.height = "";
  }
  leaveSizeToStyleSheet();

  /** @param {Shown} shown */
  function draw(shown) {
    fillLayers(shown);
    paint(shown);
    aim(shown);
    renderer.render({ scene, camera });
  }

  /** @param {Shown} shown */
  function fillLayers({ xyz_mm, shares, parts, frusta }) {
    const triangles = parts.surface ? trianglesOf(grid, xyz_mm) : [];
    layers.surface.set(triangles, xyz_mm, normalsOf(triangles, xyz_mm), shares);
    const at = (/** @type {number} */ i) => xyz_mm.subarray(3 * i, 3 * i + 3);
    layers.wire.set(parts.wire ? wireOf(grid, xyz_mm).map(([a, b]) => [at(a), at(b)]) : []);
    layers.points.set(parts.points ? xyz_mm : new Float32Array(0), parts.points ? shares : new Float32Array(0));
    layers.cameras.set(frusta.flatMap(outlineOf));
  }

  /** @param {Shown} shown */
  function paint({ map, parts, colours: own }) {
    colours.uMap.value = MAPS[map];
    colours.uPlain.value = own.plain;
    colours.uUnknown.value = own.unknown;
    layers.wire.uniforms.uColour.value = parts.surface ? own.wireOn : own.wire;
    layers.cameras.uniforms.uColour.value = own.camera;
    layers.points.uniforms.uRim.value = own.rim;
    for (const layer of [layers.wire, layers.cameras]) {
      layer.uniforms.uSize.value = [size.width, size.height];
      layer.uniforms.uWidth.value = layer.width;
    }
    const high = 2 * Math.tan((vertical() * Math.PI) / 360);
    layers.points.uniforms.uPixels.value = (TARGET_MM * dpr * size.height) / high;
    layers.points.uniforms.uLeast.value = LEAST_PIXELS * dpr;
  }

  /** Vertical angle of view, degrees. The lesser angle is always the same, so that an upright phone shows the whole object, too. */
  function vertical() {
    const aspect = size.width / size.height;
    const half = Math.tan((FOV_DEG * Math.PI) / 360);
    return aspect >= 1 ? FOV_DEG : (Math.atan(half / aspect) * 360) / Math.PI;
  }

  /** @param {Shown} shown */
  function aim({ orbit, object }) {
    const { eye, target, up, distance } = eyeOf(orbit, object, FOV_DEG);
    camera.perspective({ fov: vertical(), aspect: size.width / size.height, near: distance / 50, far: distance * 20 });
    camera.up.set(...up);
    camera.position.set(...eye);
    camera.lookAt(target);
    camera.updateMatrixWorld();
  }

  /** Projects a place onto the canvas, in CSS pixels; null behind the eye. @param {ArrayLike<number>} place_mm */
  function onCanvas(place_mm) {
    const m = camera.projectionViewMatrix;
    const part = (/** @type {number} */ i) => m[i] * place_mm[0] + m[4 + i] * place_mm[1] + m[8 + i] * place_mm[2] + m[12 + i];
    const w = part(3);
    return w <= 0 ? null : { x: ((part(0) / w + 1) / 2) * size.width, y: ((1 - part(1) / w) / 2) * size.height };
  }

  /** CSS pixels of a millimetre at the object's middle. @param {Shown} shown */
  function pixelsPerMm({ orbit, object }) {
    const { distance } = eyeOf(orbit, object, FOV_DEG);
    return size.height / (2 * Math.tan((vertical() * Math.PI) / 360)) / distance;
  }

  function dispose() {
    gl.getExtension("WEBGL_lose_context")?.loseContext();
  }

  return { draw, resize, onCanvas, pixelsPerMm, dispose };
}

/** @param {Frustum} frustum @returns {[number[], number[]][]} */
function outlineOf({ apex_mm, corners_mm }) {
  return corners_mm.flatMap((corner, i) => [[apex_mm, corner], [corner, corners_mm[(i + 1) % 4]]]);
}
