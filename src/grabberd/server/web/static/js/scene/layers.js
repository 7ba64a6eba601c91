// Layers of the drawing, each with room for all targets of a grid: discs, lines, triangles.
import { Geometry, Mesh, Program } from "../../vendor/ogl/ogl.js";
import { LINES, POINTS, SURFACE } from "./shaders.js";

/** @import { OGLRenderingContext } from "../../vendor/ogl/ogl.js" */

/** @typedef {Record<string, {value: number | number[] | number[][]}>} Uniforms */

/** Sides of the two triangles that make a line: at which end, on which side of it. */
const CORNERS = [[0, -1], [1, 1], [0, 1], [0, -1], [1, -1], [1, 1]];

/** Discs at places. @param {OGLRenderingContext} gl @param {number} capacity @param {Uniforms} colours */
export function createPoints(gl, capacity, colours) {
  const uniforms = { ...colours, uPixels: { value: 1 }, uLeast: { value: 1 }, uRim: { value: [0, 0, 0] } };
  const layer = createLayer(gl, POINTS, uniforms, { position: [3, capacity], share: [1, capacity] }, gl.POINTS);

  /** @param {Float32Array} xyz @param {Float32Array} shares of all targets; those without a place are left out */
  function set(xyz, shares) {
    const { position, share } = layer.arrays;
    let count = 0;
    for (let i = 0; i < shares.length; i += 1) {
      if (!Number.isFinite(xyz[3 * i])) continue;
      position.set(xyz.subarray(3 * i, 3 * i + 3), 3 * count);
      share[count] = shares[i];
      count += 1;
    }
    layer.changed(count);
  }
  return { ...layer, set };
}

/** Lines between places. @param {OGLRenderingContext} gl @param {number} capacity of lines @param {number} width in CSS pixels */
export function createLines(gl, capacity, width) {
  const uniforms = { uColour: { value: [0, 0, 0] }, uSize: { value: [1, 1] }, uWidth: { value: width } };
  const sizes = { position: [3, 6 * capacity], other: [3, 6 * capacity], side: [1, 6 * capacity] };
  const layer = createLayer(gl, LINES, uniforms, sizes, gl.TRIANGLES);

  /** @param {[ArrayLike<number>, ArrayLike<number>][]} segments */
  function set(segments) {
    const { position, other, side } = layer.arrays;
    for (const [i, ends] of segments.entries()) {
      for (const [k, [end, hand]] of CORNERS.entries()) {
        position.set(ends[end], 18 * i + 3 * k);
        other.set(ends[1 - end], 18 * i + 3 * k);
        side[6 * i + k] = end ? -hand : hand;
      }
    }
    layer.changed(6 * segments.length);
  }
  return { ...layer, set, width };
}

/** Triangles with normals. @param {OGLRenderingContext} gl @param {number} capacity of triangles @param {Uniforms} colours */
export function createSurface(gl, capacity, colours) {
  const sizes = { position: [3, 3 * capacity], normal: [3, 3 * capacity], share: [1, 3 * capacity] };
  const layer = createLayer(gl, SURFACE, { ...colours }, sizes, gl.TRIANGLES);

  /**
   * @param {[number, number, number][]} triangles
   * @param {Float32Array} xyz
   * @param {Float32Array} normals
   * @param {Float32Array} shares a triangle of which one corner has no value has none
   */
  function set(triangles, xyz, normals, shares) {
    const { position, normal, share } = layer.arrays;
    for (const [t, corners] of triangles.entries()) {
      const least = Math.min(...corners.map((i) => shares[i]));
      for (const [k, i] of corners.entries()) {
        position.set(xyz.subarray(3 * i, 3 * i + 3), 9 * t + 3 * k);
        normal.set(normals.subarray(3 * i, 3 * i + 3), 9 * t + 3 * k);
        share[3 * t + k] = least < 0 ? least : shares[i];
      }
    }
    layer.changed(3 * triangles.length);
  }
  return { ...layer, set };
}

/**
 * @param {OGLRenderingContext} gl
 * @param {{vertex: string, fragment: string}} shaders
 * @param {Uniforms} uniforms
 * @param {Record<string, number[]>} sizes of the attributes: numbers each, how many
 * @param {number} mode
 */
function createLayer(gl, shaders, uniforms, sizes, mode) {
  const arrays = Object.fromEntries(Object.entries(sizes).map(([name, [size, count]]) => [name, new Float32Array(size * Math.max(count, 1))]));
  const attributes = Object.fromEntries(
    Object.entries(sizes).map(([name, [size]]) => [name, { size, data: arrays[name], usage: gl.DYNAMIC_DRAW }]),
  );
  const geometry = new Geometry(gl, attributes);
  const program = new Program(gl, { ...shaders, uniforms, cullFace: false });
  const mesh = new Mesh(gl, { geometry, program, mode, frustumCulled: false });
  geometry.setDrawRange(0, 0);

  /** @param {number} count of what is to be drawn */
  function changed(count) {
    for (const attribute of Object.values(geometry.attributes)) attribute.needsUpdate = true;
    geometry.setDrawRange(0, count);
    mesh.visible = count > 0;
  }
  return { mesh, uniforms, arrays, changed };
}
