// A map: the target grid as cells, coloured by a value; one without a value is hatched, and says why.
import { colourAt, css } from "../scene/colours.js";
import { shareOf } from "../scene/scale.js";

/** @import { Scale } from "../scene/scale.js" */

const SVG = "http://www.w3.org/2000/svg";
const WIDTH = 10;
const HEIGHT = 6;
const HATCH = "analysis-hatch";

/** @param {string} tag @param {Record<string, string | number>} attributes */
function make(tag, attributes) {
  const made = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, String(value));
  return made;
}

/** @param {(place: number) => void} touched the place of a target in the grid's lists */
export function createMapPicture(touched) {
  const cells = make("g", {});
  const mark = make("rect", { width: WIDTH, height: HEIGHT, class: "map-mark", visibility: "hidden" });
  const element = make("svg", { class: "map-picture", role: "img" });
  const hatch = make("pattern", { id: HATCH, width: 2, height: 2, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)" });
  hatch.append(make("rect", { width: 2, height: 2, class: "map-empty" }), make("line", { x1: 0, y1: 0, x2: 0, y2: 2, class: "map-hatch" }));
  const definitions = make("defs", {});
  definitions.append(hatch);
  element.append(definitions, cells, mark);
  element.addEventListener("click", (event) => {
    const place = /** @type {SVGElement} */ (event.target).dataset?.place;
    if (place !== undefined) touched(Number(place));
  });

  /**
   * @param {{row: number[], column: number[]}} grid
   * @param {(number | null)[]} values
   * @param {Scale | null} scale
   * @param {string} words what it shows
   */
  function show(grid, values, scale, words) {
    const [columns, rows] = [Math.max(...grid.column) + 1, Math.max(...grid.row) + 1];
    element.setAttribute("viewBox", `0 0 ${columns * WIDTH} ${rows * HEIGHT}`);
    element.setAttribute("aria-label", words);
    cells.replaceChildren(...values.map((value, i) => cell(grid, i, value, scale)));
  }

  /** @param {{row: number[], column: number[]}} grid @param {number} i @param {number | null} value @param {Scale | null} scale */
  function cell(grid, i, value, scale) {
    const fill = value === null || !scale ? `url(#${HATCH})` : css(colourAt(scale.map, shareOf(scale, value)));
    return make("rect", { x: grid.column[i] * WIDTH, y: grid.row[i] * HEIGHT, width: WIDTH, height: HEIGHT, fill, class: "map-cell", "data-place": i });
  }

  /** @param {{row: number[], column: number[]}} grid @param {number | null} place null: none */
  function choose(grid, place) {
    mark.setAttribute("visibility", place === null ? "hidden" : "visible");
    if (place === null) return;
    mark.setAttribute("x", String(grid.column[place] * WIDTH));
    mark.setAttribute("y", String(grid.row[place] * HEIGHT));
  }
  return { element, show, choose };
}
