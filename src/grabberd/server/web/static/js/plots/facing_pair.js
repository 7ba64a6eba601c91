// Of which two targets the width is drawn.

/**
 * The pair of facing targets that shows the width best: the outermost that is seen nearly as often as any.
 * @param {{widths: {width_mm: number | null}[]}[]} samples
 * @returns {number} its place in `widths`; −1 where there is none
 */
export function pairOf(samples) {
  const pairs = Math.max(0, ...samples.map((sample) => sample.widths.length));
  const counts = Array.from({ length: pairs }, (_, i) => samples.filter((sample) => sample.widths[i]?.width_mm != null).length);
  const most = Math.max(0, ...counts);
  return most ? counts.findIndex((count) => count >= 0.9 * most) : -1;
}
