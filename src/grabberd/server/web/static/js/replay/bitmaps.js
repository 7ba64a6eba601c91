// Pictures that are decoded ahead of the playhead, a few at a time: a decoded one takes as much memory as hundreds of others.

/** @import { ReplayPicture } from "./messages.js" */

const KEPT = 24;

export function createBitmaps() {
  /** @type {Map<number, {of: ReplayPicture, bitmap: ImageBitmap | null, ready: Promise<ImageBitmap | null>}>} */
  const known = new Map();
  let ended = false;

  /** Decodes a picture, once. @param {ReplayPicture} picture @returns {Promise<ImageBitmap | null>} null where it cannot be */
  function decode(picture) {
    const before = known.get(picture.n);
    if (before) return before.ready;
    const one = { of: picture, bitmap: /** @type {ImageBitmap | null} */ (null), ready: createImageBitmap(picture.png).catch(() => null) };
    known.set(picture.n, one);
    one.ready.then((bitmap) => {
      if (ended || known.get(picture.n) !== one) bitmap?.close();
      else one.bitmap = bitmap;
    });
    while (known.size > KEPT) forget(known.keys().next().value ?? picture.n);
    return one.ready;
  }

  /** @param {number} n */
  function forget(n) {
    known.get(n)?.bitmap?.close();
    known.delete(n);
  }

  return {
    decode,
    /** A picture that is decoded already. @param {number} n */
    at: (n) => known.get(n)?.bitmap ?? null,
    end() {
      ended = true;
      for (const n of [...known.keys()]) forget(n);
    },
  };
}
