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
  { id: "plots", route: "plots", under: "shape", load: () => import("./plots.js") },
  { id: "captures", route: "captures", nav: "captures", load: () => import("./captures.js") },
  { id: "capture", route: "captures/:id", under: "captures", load: () => import("./capture.js") },
  { id: "replay", route: "replay/:id", under: "captures", load: () => import("./replay.js") },
  { id: "replay-at", route: "replay/:id/:n", under: "captures", load: () => import("./replay.js") },
  // Addresses of an earlier edition, kept in notes and bookmarks: they become the room's own as soon as it is open.
  { id: "replay-shape", route: "shape/:id", under: "captures", load: () => import("./replay.js") },
  { id: "replay-plots", route: "plots/:id", under: "captures", load: () => import("./replay.js") },
  { id: "replay-plots-target", route: "plots/:id/:target", under: "captures", load: () => import("./replay.js") },
  { id: "compare", route: "compare", under: "captures", load: () => import("./compare.js") },
  { id: "compare-of", route: "compare/:ids", under: "captures", load: () => import("./compare.js") },
  { id: "analysis", route: "analysis/:id", under: "captures", load: () => import("./analysis.js") },
  { id: "analysis-of", route: "analysis/:id/:n", under: "captures", load: () => import("./analysis.js") },
  { id: "profiles", route: "profiles", under: "captures", load: () => import("./profiles.js") },
  { id: "profiles-new", route: "profiles/:kind", under: "captures", load: () => import("./profiles.js") },
  { id: "profile", route: "profiles/:kind/:name", under: "captures", load: () => import("./profiles.js") },
  { id: "tests", route: "tests", nav: "tests", load: () => import("./tests.js") },
  { id: "tests-of", route: "tests/:kind", under: "tests", load: () => import("./tests.js") },
  { id: "tests-making", route: "tests/:kind/:id", under: "tests", load: () => import("./tests.js") },
  { id: "test", route: "test/:test", under: "tests", load: () => import("./tests.js") },
  { id: "calibration", route: "calibration", nav: "calibration", load: () => import("./calibration.js") },
  { id: "calibration-step", route: "calibration/:step", under: "calibration", load: () => import("./calibration.js") },
  { id: "calibration-step-of", route: "calibration/:step/:id", under: "calibration", load: () => import("./calibration.js") },
];
