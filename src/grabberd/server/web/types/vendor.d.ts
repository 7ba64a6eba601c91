// The vendored libraries have the types that their npm packages come with; package.json pins the vendored versions.
declare module "*/vendor/uplot/uPlot.esm.js" {
  export { default } from "uplot";
}
declare module "*/vendor/ogl/ogl.js" {
  export { Camera, Geometry, Mesh, Program, Renderer, Transform } from "ogl";
  export type { OGLRenderingContext } from "ogl";
}
