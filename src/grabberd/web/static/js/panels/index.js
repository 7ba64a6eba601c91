// Every panel there is, in the order of the navigation. A module is loaded when it is first shown.

/**
 * @typedef {object} Entry
 * @property {string} id
 * @property {string} route pattern of the address: "captures/:id"
 * @property {string} [nav] symbol in the navigation; without one it is not there
 * @property {string} [under] id of the entry that the navigation shows as the present one
 * @property {string} role the least that may see it
 * @property {() => Promise<{panel: any}>} load
 */

/** @type {Entry[]} the first is where everybody begins; its title is the text `core.nav.ID` */
export const ENTRIES = [
  { id: "operate", route: "operate", nav: "operate", role: "viewer", load: () => import("./operate.js") },
  { id: "live", route: "live", nav: "live", role: "viewer", load: () => import("./live.js") },
  { id: "shape", route: "shape", nav: "shape", role: "viewer", load: () => import("./shape.js") },
  { id: "shape-of", route: "shape/:id", under: "shape", role: "viewer", load: () => import("./shape.js") },
  { id: "plots", route: "plots", under: "shape", role: "viewer", load: () => import("./plots.js") },
  { id: "plots-of", route: "plots/:id", under: "shape", role: "viewer", load: () => import("./plots.js") },
  { id: "plots-of-target", route: "plots/:id/:target", under: "shape", role: "viewer", load: () => import("./plots.js") },
  { id: "captures", route: "captures", nav: "captures", role: "viewer", load: () => import("./captures.js") },
  { id: "capture", route: "captures/:id", under: "captures", role: "viewer", load: () => import("./capture.js") },
  { id: "compare", route: "compare", under: "captures", role: "viewer", load: () => import("./compare.js") },
  { id: "compare-one", route: "compare/:id", under: "captures", role: "viewer", load: () => import("./compare.js") },
  { id: "compare-two", route: "compare/:id/:other", under: "captures", role: "viewer", load: () => import("./compare.js") },
  { id: "analysis", route: "analysis/:id", under: "captures", role: "viewer", load: () => import("./analysis.js") },
  { id: "analysis-of", route: "analysis/:id/:n", under: "captures", role: "viewer", load: () => import("./analysis.js") },
  { id: "calibration", route: "calibration", nav: "calibration", role: "viewer", load: () => import("./calibration.js") },
  { id: "calibration-step", route: "calibration/:step", under: "calibration", role: "viewer", load: () => import("./calibration.js") },
  { id: "calibration-step-of", route: "calibration/:step/:id", under: "calibration", role: "viewer", load: () => import("./calibration.js") },
];
