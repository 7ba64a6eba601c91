// Curves of a capture, a window of it at a time: the width of the middle section, or a target's place with its σ.
import { facingOf, widthOf } from "./widths.js";
import { pathOf } from "./source.js";

/** @import { Grid } from "../scene/grid.js" */
/** @import { FieldPoints } from "types/documents" */
/** @import { Api } from "types/routes" */

const MOST_POINTS = 200_000;
const KEPT = 8;

/**
 * @typedef {object} Sample
 * @property {number} n
 * @property {number | null} value
 * @property {number} sigma 0 where it is not known
 *
 * @typedef {{what: "width" | "x" | "y" | "z", target: number}} What
 */

/**
 * @param {Api} api
 * @param {string} id of the capture
 * @param {number} run
 * @param {Grid} grid
 */
export function createCourses(api, id, run, grid) {
  /** @type {Map<string, Promise<Sample[]>>} */
  const known = new Map();
  const pairs = facingOf(grid);

  /** @param {What} what @param {number} first @param {number} end */
  async function ask({ what, target }, first, end) {
    const targets = what === "width" ? pairs.flat() : [target];
    const query = targets.map((one) => `target=${one}`).join("&");
    const { fields } = await api.get(`${pathOf(id)}/points?run=${run}&first_n=${first}&end_n=${end}&max_points=${MOST_POINTS}&${query}`);
    if (what !== "width") return fields.map((field) => placeOf(field, what));
    const widths = widthOf(fields, pairs);
    return fields.map(({ n }) => ({ n, value: widths.get(n) ?? null, sigma: 0 }));
  }

  return {
    /** The samples of a window; asked for once as long as it is one of the last. @param {What} what @param {number} first @param {number} end */
    of(what, first, end) {
      const key = `${what.what} ${what.target} ${first} ${end}`;
      const found = known.get(key) ?? ask(what, first, end);
      known.delete(key);
      known.set(key, found);
      found.catch(() => known.delete(key));
      while (known.size > KEPT) known.delete(known.keys().next().value ?? "");
      return found;
    },
  };
}

/** @param {FieldPoints} field @param {"x" | "y" | "z"} axis @returns {Sample} */
function placeOf(field, axis) {
  return { n: field.n, value: field[`${axis}_mm`][0] ?? null, sigma: field[`sigma_${axis}_mm`][0] ?? 0 };
}
