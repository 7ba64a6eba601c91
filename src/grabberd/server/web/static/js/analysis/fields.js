// The inputs of an analysis: groups, kinds and numbers with their units. Nothing has a default.

/**
 * @typedef {object} Asked a number that is asked for
 * @property {string} name
 * @property {string} unit
 * @property {boolean} [free] it may stay empty where others of its part do not
 *
 * @typedef {object} Part
 * @property {string} path where it stands in the inputs
 * @property {string[]} [kinds] what may be chosen; without them there are only numbers
 * @property {Record<string, Asked[]>} numbers of every kind, or of "" where nothing is chosen
 */

/** @param {string} name @param {string} unit @param {boolean} [free] @returns {Asked} */
const number = (name, unit, free = false) => ({ name, unit, free });
const CONSTANT = [number("kpa", "kPa"), number("sigma_kpa", "kPa")];
const WAVE = [
  number("rate_per_min", "1/min"), number("ratio", "0…1"), number("system_kpa", "kPa"), number("sigma_kpa", "kPa"),
  number("a_s", "s"), number("c_s", "s"), number("start_s", "s", true), number("start_sigma_s", "s", true),
];
const MATERIAL = [
  number("E_mpa", "MPa"), number("E_sigma_mpa", "MPa", true), number("wall_mm", "mm"), number("wall_sigma_mm", "mm", true),
  number("poisson", "0…0.5", true), number("F0_n", "N"), number("F0_sigma_n", "N", true), number("radius_mm", "mm", true), number("target_mm", "mm"),
  number("first_end_mm", "mm", true), number("last_end_mm", "mm", true),
];

/** @type {Record<string, Part[]>} the parts of every group */
export const GROUPS = {
  reference: [{ path: "reference", kinds: ["nominal", "field", "phase"], numbers: { nominal: [], field: [number("field", "")], phase: [number("phase", "0…1")] } }],
  material: [{ path: "material", kinds: ["neo_hookean", "linear"], numbers: { neo_hookean: MATERIAL, linear: MATERIAL } }],
  vacuum: [
    { path: "vacuum.pulsation", kinds: ["constant", "wave", "channel", "log"], numbers: { constant: CONSTANT, wave: WAVE, channel: [], log: [] } },
    { path: "vacuum.liner", kinds: ["constant", "channel", "log"], numbers: { constant: CONSTANT, channel: [], log: [] } },
    { path: "vacuum.clock", kinds: ["light", "offset", "lag"], numbers: { light: [], offset: [number("s", "s"), number("sigma_s", "s")], lag: [number("opening_s", "s"), number("closing_s", "s"), number("sigma_s", "s"), number("near_s", "s")] } },
  ],
  pressure: [{ path: "", numbers: { "": [number("sought_kpa", "kPa", true)] } }],
  sections: [
    { path: "plane", kinds: ["symmetry", "own"], numbers: { symmetry: [], own: ["x", "y", "z", "nx", "ny", "nz"].map((name) => number(name, name.length > 1 ? "" : "mm")) } },
    { path: "", numbers: { "": [number("height1", "mm", true), number("height2", "mm", true), number("height3", "mm", true), number("phases", "", true)] } },
  ],
};
export const NAMES = Object.keys(GROUPS);
