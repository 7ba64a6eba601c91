// Shaders. A share is the place of a value on the colour scale, 0 to 1; −1: no value; −2: none wanted.

const COLOUR = `
uniform vec3 uMap[17];
uniform vec3 uPlain;
uniform vec3 uUnknown;
vec3 colourOf(float share) {
  if (share < -1.5) return uPlain;
  if (share < -0.001) return uUnknown;
  float place = clamp(share, 0.0, 1.0) * 16.0;
  int below = min(int(place), 15);
  return mix(uMap[below], uMap[below + 1], place - float(below));
}`;

const HEAD = `#version 300 es
precision highp float;
`;

/** Discs of the targets' size. */
export const POINTS = {
  vertex: `${HEAD}
in vec3 position;
in float share;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
uniform float uPixels;
uniform float uLeast;
out float vShare;
void main() {
  vec4 eye = modelViewMatrix * vec4(position, 1.0);
  gl_Position = projectionMatrix * eye;
  gl_Position.z -= 0.002 * gl_Position.w;
  gl_PointSize = max(uLeast, uPixels / -eye.z);
  vShare = share;
}`,
  fragment: `${HEAD}${COLOUR}
uniform vec3 uRim;
in float vShare;
out vec4 colour;
void main() {
  vec2 place = gl_PointCoord * 2.0 - 1.0;
  float apart = dot(place, place);
  if (apart > 1.0) discard;
  colour = vec4(mix(colourOf(vShare), uRim, smoothstep(0.55, 0.72, apart)), 1.0);
}`,
};

/** Lines of a width in pixels, cut off where they would pass behind the eye. */
export const LINES = {
  vertex: `${HEAD}
in vec3 position;
in vec3 other;
in float side;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
uniform vec2 uSize;
uniform float uWidth;
const float NEAR = 1.0;
vec4 before(vec4 one, vec4 two) {
  return one.w >= NEAR ? one : mix(one, two, (NEAR - one.w) / (two.w - one.w));
}
void main() {
  mat4 all = projectionMatrix * modelViewMatrix;
  vec4 a = all * vec4(position, 1.0);
  vec4 b = all * vec4(other, 1.0);
  if (a.w < NEAR && b.w < NEAR) {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    return;
  }
  vec4 from = before(a, b);
  vec4 to = before(b, a);
  vec2 along = (to.xy / to.w - from.xy / from.w) * uSize;
  along = length(along) > 1e-6 ? normalize(along) : vec2(1.0, 0.0);
  vec2 across = vec2(-along.y, along.x) * side * uWidth / uSize;
  gl_Position = vec4(from.xy + across * from.w, from.z - 0.001 * from.w, from.w);
}`,
  fragment: `${HEAD}
uniform vec3 uColour;
out vec4 colour;
void main() {
  colour = vec4(uColour, 1.0);
}`,
};

/** Triangles under a light from the left, above and before the picture; the inner face is darker. */
export const SURFACE = {
  vertex: `${HEAD}
in vec3 position;
in vec3 normal;
in float share;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
out vec3 vNormal;
out float vShare;
void main() {
  vNormal = mat3(modelViewMatrix) * normal;
  vShare = share;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}`,
  fragment: `${HEAD}${COLOUR}
in vec3 vNormal;
in float vShare;
out vec4 colour;
const vec3 LIGHT = normalize(vec3(-0.35, 0.45, 0.82));
void main() {
  vec3 normal = normalize(vNormal) * (gl_FrontFacing ? 1.0 : -1.0);
  float bright = 0.45 + 0.55 * max(dot(normal, LIGHT), 0.0);
  bright *= gl_FrontFacing ? 1.0 : 0.72;
  if (vShare > -1.5) bright = (1.0 + bright) / 2.0;
  colour = vec4(colourOf(vShare) * bright, 1.0);
}`,
};
