// Packed bits as a picture: white targets on black.

/** @import { Preview } from "./message.js" */

// Image data are bytes R, G, B, A; as one little-endian word opacity is the highest byte.
const WHITE = 0xffffffff;
const BLACK = 0xff000000;

/** For every byte its eight pixels, the leftmost from the highest bit. */
const PIXELS = Uint32Array.from({ length: 256 * 8 }, (_, i) => ((i >> 3) >> (7 - (i & 7))) & 1 ? WHITE : BLACK);

/**
 * Draws the bits into a canvas of their own size.
 * @param {HTMLCanvasElement} canvas
 * @param {Preview} preview
 */
export function drawBits(canvas, { bits, rows, columns }) {
  const width = 8 * Math.ceil(columns / 8);
  if (canvas.width !== width) canvas.width = width;
  if (canvas.height !== rows) canvas.height = rows;
  const image = new ImageData(width, rows);
  const pixels = new Uint32Array(image.data.buffer);
  for (let i = 0; i < bits.length; i += 1) pixels.set(PIXELS.subarray(8 * bits[i], 8 * bits[i] + 8), 8 * i);
  canvas.getContext("2d")?.putImageData(image, 0, 0);
}
