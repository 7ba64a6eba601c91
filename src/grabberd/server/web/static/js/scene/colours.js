// Values as colours: even steps of lightness, told apart with any colour vision.

/** @typedef {[number, number, number]} Rgb red, green, blue from 0 to 1 */

/** From the least to the greatest: viridis, as in the reports. */
const RISING = "440154 48186a 472d7b 424086 3b528b 33638d 2c728e 26828e 21918c 1f9f88 27ad81 3dbc74 5cc863 81d34d aadc32 d5e21a fde725";
/** From minus to plus by way of nought: blue, light grey, brown, of the same lightness on both sides. */
const SIGNED = "02468b 1a5aa3 316eb9 4a83cb 6598da 83aee5 a3c3ed c7d8ef ededed e9d2c1 e0b799 d39e76 c48656 b1703b 9c5b22 85490d 6c3801";

/** @param {string} hexes @returns {Rgb[]} */
const parsed = (hexes) => hexes.split(" ").map(rgb);

/** @param {string} hex */
function rgb(hex) {
  const at = (/** @type {number} */ i) => parseInt(hex.slice(i, i + 2), 16) / 255;
  return /** @type {Rgb} */ ([at(0), at(2), at(4)]);
}

/** The maps by name, each of seventeen colours in even steps. */
export const MAPS = { rising: parsed(RISING), signed: parsed(SIGNED) };

/**
 * The colour of a share of a map; beyond its ends the outermost ones.
 * @param {keyof typeof MAPS} map
 * @param {number} share from 0 to 1
 * @returns {Rgb}
 */
export function colourAt(map, share) {
  const colours = MAPS[map];
  const place = Math.min(Math.max(share, 0), 1) * (colours.length - 1);
  const below = Math.min(Math.floor(place), colours.length - 2);
  const mix = (/** @type {number} */ i) => colours[below][i] + (place - below) * (colours[below + 1][i] - colours[below][i]);
  return [mix(0), mix(1), mix(2)];
}

/** As CSS has it. @param {Rgb} colour */
export function css([red, green, blue]) {
  return `rgb(${[red, green, blue].map((part) => Math.round(part * 255)).join(" ")})`;
}
