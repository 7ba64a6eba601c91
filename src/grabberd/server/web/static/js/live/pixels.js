// Pictures of the preview as pixels: bits white on black, grey values as they are or with what is clipped in colour.

/** @import { Preview } from "./message.js" */

// Image data are bytes R, G, B, A; as one little-endian word opacity is the highest byte.
const OPAQUE = 0xff000000;
const GREY = Uint32Array.from({ length: 256 }, (_, level) => OPAQUE | (level * 0x010101));
/** Values that only a pixel has that is as bright, or as dark, as the camera gets. */
const WHITE = 255;
const BLACK = 0;
const TINTED = GREY.slice();
TINTED[WHITE] = 0xff3a2aff; // red
TINTED[BLACK] = 0xffd06010; // blue

/** For every byte its eight pixels, the leftmost from the highest bit. */
const EIGHT = Uint32Array.from({ length: 256 * 8 }, (_, i) => GREY[((i >> 3) >> (7 - (i & 7))) & 1 ? 255 : 0]);

/**
 * Draws a picture into a canvas of its own size.
 * @param {HTMLCanvasElement} canvas
 * @param {Preview} preview
 * @param {boolean} tinted over- and under-exposed pixels in colour
 */
export function drawPixels(canvas, preview, tinted) {
  const { pixels, rows, columns } = preview;
  const width = preview.isGrey ? columns : 8 * Math.ceil(columns / 8);
  if (canvas.width !== width) canvas.width = width;
  if (canvas.height !== rows) canvas.height = rows;
  const image = imageOf(canvas, width, rows);
  const words = new Uint32Array(image.data.buffer);
  if (preview.isGrey) {
    const colours = tinted ? TINTED : GREY;
    for (let i = 0; i < pixels.length; i += 1) words[i] = colours[pixels[i]];
  } else {
    for (let i = 0; i < pixels.length; i += 1) words.set(EIGHT.subarray(8 * pixels[i], 8 * pixels[i] + 8), 8 * i);
  }
  canvas.getContext("2d")?.putImageData(image, 0, 0);
}

/** The canvas's own image, used again: 25 new ones a second would be 20 MB to clear away. @type {WeakMap<HTMLCanvasElement, ImageData>} */
const images = new WeakMap();

/** @param {HTMLCanvasElement} canvas @param {number} width @param {number} height */
function imageOf(canvas, width, height) {
  const known = images.get(canvas);
  if (known?.width === width && known.height === height) return known;
  const made = new ImageData(width, height);
  images.set(canvas, made);
  return made;
}
