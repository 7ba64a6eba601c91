// Every panel there is, in the order of the navigation. A module is loaded when it is first shown.

/** @import { Context } from "../core/context.js" */

/**
 * @typedef {object} Entry
 * @property {string} id
 * @property {string} route pattern of the address: "captures/:id"
 * @property {string} [nav] symbol in the navigation; without one it is not there
 * @property {string} [under] id of the entry that the navigation shows as the present one
 * @property {() => Promise<{panel: Panel}>} load
 *
 * @typedef {object} Panel
 * @property {string} title key of its text
 * @property {(element: HTMLElement, context: PanelContext) => {unmount?: () => void}} mount
 *
 * @typedef {Context & {parameters: Record<string, string | undefined>}} PanelContext parameters: of the address
 */

/** @type {Entry[]} the first is where everybody begins; its title is the text `core.nav.ID` */
export const ENTRIES = [
  { id: "operate", route: "operate", nav: "operate", load: () => import("./operate.js") },
  { id: "live", route: "live", nav: "live", load: () => import("./live.js") },
  { id: "shape", route: "shape", nav: "shape", load: () => import("./shape.js") },
  { id: "shape-of", route: "shape/:id", under: "shape", load: () => import("./shape.js") },
  { id: "plots", route: "plots", under: "shape", load: () => import("./plots.js") },
  { id: "plots-of", route: "plots/:id", under: "shape", load: () => import("./plots.js") },
  { id: "plots-of-target", route: "plots/:id/:target", under: "shape", load: () => import("./plots.js") },
  { id: "captures", route: "captures", nav: "captures", load: () => import("./captures.js") },
  { id: "capture", route: "captures/:id", under: "captures", load: () => import("./capture.js") },
  { id: "compare", route: "compare", under: "captures", load: () => import("./compare.js") },
  { id: "compare-one", route: "compare/:id", under: "captures", load: () => import("./compare.js") },
  { id: "compare-two", route: "compare/:id/:other", under: "captures", load: () => import("./compare.js") },
  { id: "analysis", route: "analysis/:id", under: "captures", load: () => import("./analysis.js") },
  { id: "analysis-of", route: "analysis/:id/:n", under: "captures", load: () => import("./analysis.js") },
  { id: "profiles", route: "profiles", under: "captures", load: () => import("./profiles.js") },
  { id: "profiles-new", route: "profiles/:kind", under: "captures", load: () => import("./profiles.js") },
  { id: "profile", route: "profiles/:kind/:name", under: "captures", load: () => import("./profiles.js") },
  { id: "calibration", route: "calibration", nav: "calibration", load: () => import("./calibration.js") },
  { id: "calibration-step", route: "calibration/:step", under: "calibration", load: () => import("./calibration.js") },
  { id: "calibration-step-of", route: "calibration/:step/:id", under: "calibration", load: () => import("./calibration.js") },
];
