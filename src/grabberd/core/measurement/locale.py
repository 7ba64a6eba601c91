"""Locale decoding at 1 bit: the mean of all positions that explain a blob's bits (Havelock's locales).

The positions that produce the same pattern of bits are its locale. Each position of a fine grid is weighted
by the likelihood of the pattern, given size, spread, noise and line jitter, as looked up in tables; the
weighted mean is the estimate of least error, and the weighted variance is its variance.
"""

import math
from collections.abc import Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array
from grabberd.core.field import PackedField
from grabberd.core.measurement.labelling import short
from grabberd.core.measurement.line_shifts import Rows
from grabberd.core.measurement.locale_table import (
    NOMINAL_FRACTION,
    STEPS_X,
    STEPS_Y,
    Appearance,
    Grid,
    Sizes,
    Table,
    is_delivered,
    moments,
    moments_of,
    sizes_of,
    table,
    threshold_fraction,
)
from grabberd.core.measurement.locators.locator import Located, Seen, meant_for
from grabberd.core.measurement.noise import binary_sigma_px

Whole = NDArray[np.int64]


HALF = STEPS_X / 2
ROUNDED_PX = (0.5, 0.25)
"""Steps to which half axes are rounded, so that few tables are needed; blobs are stretched to match."""


Kind = tuple[float, float]
"""Half axes of the region above the threshold, in x and y: what blobs that use the same table share."""


class Cuts(NamedTuple):
    """The R rows of M blobs, blob by blob, in steps of the fine grid from the blob's middle position.

    Attributes:
        first: (M,) int64, start index of each blob's rows, which are contiguous.
        interpolated: (R,) int64, 1 for an interpolated row.
        row: (R,) int64, the row.
        start: (R,) int64, its first pixel.
        end: (R,) int64, the pixel after its last.
        phase: (M,) int64, distance to any pixel.
    """

    first: Whole
    interpolated: Whole
    row: Whole
    start: Whole
    end: Whole
    phase: Whole


class Patterns(NamedTuple):
    """All blobs of a field that may be targets, grouped by kind.

    Attributes:
        blob: (M,) int64, their components.
        middle: (M, 2) float64, columns and rows: the fine-grid position nearest to each centroid.
        stretched: (M, 2) float64, stretch in x and y.
        kinds: Their kinds, the most frequent first.
        blobs: Number of blobs of each kind.
        cuts: Their rows relative to `middle`.
        fraction: The threshold's share of the contrast.
    """

    blob: Whole
    middle: Array
    stretched: Array
    kinds: list[Kind]
    blobs: list[int]
    cuts: Cuts
    fraction: float


def patterns_of(seen: Seen, centres: Array) -> Patterns:
    """Prepare the patterns of all blobs that lie wholly inside the field and have a target's size.

    Args:
        seen: A field of 1 bit.
        centres: (N, 2) float64, centroids of its N components, columns and rows.
    """
    packed = seen.packed
    whole = seen.whole
    moments = moments_of(packed, seen.runs, seen.label, centres)
    sizes = sizes_of(moments, whole, centres, packed)
    fraction = NOMINAL_FRACTION
    if packed.is_doubled:
        fraction = threshold_fraction(seen.shapes.pixels, moments, sizes, whole, seen.settings.spread_px)
    blob, kinds, count = _by_kind(whole.nonzero()[0], sizes)
    steps = np.array([STEPS_X, STEPS_Y * packed.y_step])
    before = np.array([0, packed.first_delivered])
    middle = np.rint((centres[blob] - before) * steps).astype(np.int64)
    wanted = np.repeat(kinds, count, axis=0).reshape(-1, 2)
    stretched = wanted / np.array(sizes[:2]).T[blob]
    cuts = _cuts(packed, Rows.among(seen, blob), middle, stretched, sizes.lean[blob])
    return Patterns(blob, middle / steps + before, stretched, kinds, count, cuts, fraction)


def _by_kind(blob: Whole, sizes: Sizes) -> tuple[Whole, list[Kind], list[int]]:
    """Group blobs by kind: the blobs, the kinds, and the number of blobs of each."""
    width, height = (
        np.rint(axis[blob] / rounded_px).astype(np.int64)
        for axis, rounded_px in zip(sizes[:2], ROUNDED_PX, strict=True)
    )
    heights = int(height.max(initial=0)) + 1
    code = width * heights + height
    count = np.bincount(code)
    by_count = np.argsort(-count, kind="stable")[: np.count_nonzero(count)]
    rank = np.empty(len(count), np.int64)
    rank[by_count] = np.arange(len(by_count))
    wide, high = np.divmod(by_count, heights)
    kinds = list(zip((ROUNDED_PX[0] * wide).tolist(), (ROUNDED_PX[1] * high).tolist(), strict=True))
    order = short(rank[code], len(by_count)).argsort(kind="stable")
    return blob[order], kinds, count[by_count].tolist()


def _cuts(packed: PackedField, rows: Rows, middle: Whole, stretched: Array, lean: Array) -> Cuts:
    """Rows of blobs relative to their `middle` (M, 2) steps; stretched and made upright."""
    of, row, first, last = rows
    begin = np.cumsum(np.bincount(of, minlength=len(middle)))
    x, y, wider, higher, leaning = np.array([*middle.T, *stretched.T, lean])[:, of]
    down = (row - packed.first_delivered) * (packed.y_step * STEPS_Y) - y
    origin = x + HALF + leaning * down * (STEPS_X / STEPS_Y)
    # A pixel's position is a whole number; what is stretched is its edge, half a pixel before.
    start, end = (
        np.rint((edge * STEPS_X - origin) * wider + HALF).astype(np.int64) for edge in (first, last + 1)
    )
    return Cuts(
        first=np.append(0, begin[:-1])[: len(middle)],
        interpolated=1 - is_delivered(packed, row).astype(np.int64),
        row=np.rint(down * higher).astype(np.int64),
        start=start,
        end=end,
        phase=-middle[:, 0],
    )


Single = NDArray[np.float32]


class Posterior(NamedTuple):
    """Posterior of M blobs' positions.

    Attributes:
        from_middle_px: (M, 2) mean position, frame pixels.
        variance_px2: (M, 2) its variance.
        evidence: (M,) log marginal likelihood of the pattern, up to a constant.
    """

    from_middle_px: Array
    variance_px2: Array
    evidence: Array

    @classmethod
    def of(cls, likelihood: Single, y_step: int) -> "Posterior":
        """Compute from the log likelihoods (M, G) of all positions under a flat prior."""
        greatest, weight = _weights(likelihood)
        sums = (weight @ moments(y_step)).astype(np.float64)
        total = sums[:, 0]
        means = sums[:, 1:] / total[:, np.newaxis]
        mean = means[:, :2]
        evidence = greatest.astype(np.float64) + np.log(total)
        return cls(mean, means[:, 2:] - mean * mean, evidence)


def evidence_of(likelihood: Single) -> Array:
    """(M,) evidence as in `Posterior`."""
    greatest, weight = _weights(likelihood)
    return greatest + np.log(weight.sum(axis=1, dtype=np.float64))


def _weights(likelihood: Single) -> tuple[Single, Single]:
    greatest = likelihood.max(axis=1)
    weight = likelihood - greatest[:, np.newaxis]
    return greatest, np.exp(weight, out=weight)


class Entries(NamedTuple):
    """Table entries of M blobs in the tables of their kinds.

    Attributes:
        entry: (M, E) int64 entries for the space above and below each blob and for its rows' starts and ends;
            padded with the empty entry for blobs with fewer rows.
        rows: Greatest number of rows of any blob, by kind.
    """

    entry: Whole
    rows: list[int]

    @classmethod
    def of(cls, cuts: Cuts, grids: Sequence[Grid], blobs: Sequence[int]) -> "Entries":
        """Look up blobs of kinds with these grids; `blobs` of each kind are contiguous."""
        bounds = np.append(cuts.first, len(cuts.row))
        rows = np.diff(bounds)
        of_blobs = np.repeat(np.array(grids), blobs, axis=0)
        of_blob, grid = Grid(*of_blobs.T), Grid(*of_blobs.repeat(rows, axis=0).T)
        row = grid.row_of(cuts.row)
        width = 2 * int(rows.max(initial=0)) + 2
        flat = np.repeat(of_blob.empty, width)
        slot = np.repeat(np.arange(len(rows)) * width - 2 * cuts.first, rows) + 2 * np.arange(1, len(row) + 1)
        for part, x in enumerate((cuts.start, cuts.end)):
            flat[slot + part] = grid.entry_of_cut(part, cuts.interpolated, x, row)
        entry = flat.reshape(-1, width)
        for part, at in enumerate((cuts.first, bounds[1:] - 1)):
            entry[:, part] = of_blob.entry_of_cap(part, cuts.interpolated[at], cuts.phase, row[at])
        begin = np.array([0, *accumulate(blobs[:-1])])
        return cls(entry, np.maximum.reduceat(rows, begin).tolist())

    def first(self, blobs: int) -> "Entries":
        """Entries of the first blobs only, all of one kind."""
        return Entries(self.entry[:blobs], self.rows[:1])


def likelihoods(tables: Sequence[Table], blobs: Sequence[int], entries: Entries) -> Single:
    """(M, G) log likelihood of M blobs at the positions around the middle of each.

    Args:
        tables: One for each kind.
        blobs: Number of blobs of each kind, which are contiguous.
        entries: Their entries in the tables.
    """
    _, *size = tables[0].windows.shape
    positions = size[0] * size[1]
    summed = np.empty((sum(blobs), 1, positions), np.float32)
    ones, begin = np.ones((1, entries.entry.shape[1]), np.float32), 0
    for (windows, _), count, rows in zip(tables, blobs, entries.rows, strict=True):
        end, width = begin + count, 2 * rows + 2
        looked_up = windows[entries.entry[begin:end, :width]].reshape(count, width, positions)
        np.matmul(ones[:, :width], looked_up, out=summed[begin:end])
        begin = end
    return summed[:, 0]


NOISES = (0.03, 0.05, 0.1)
"""Candidates for a pixel's standard deviation, in contrasts; the field's own bits decide between them."""
NOISE_BLOBS = 24
"""Number of blobs that decide the noise."""
JITTER_OF_CENTRE = 0.54
"""Variance of a centroid's x per variance of a line's shift, times the lines that its radius spans."""
JITTER_OF_ENDS, JITTER_OF_DOUBLED_ENDS = 0.5, 0.25
"""Share of that in the posterior: it models a row's ends, and interpolated rows, as independent."""
MOST_JITTER = 0.7
"""Greatest share of the variance of x attributed to line jitter; the rest is the blob's own."""
UNEXPLAINED = 20.0
"""Log likelihood below the median blob's at which a blob is no target: three pixels are wrong (see SURE)."""


def locate_by_locale(seen: Seen) -> Located:
    """Locate by posterior means; a blob that no target explains keeps its centroid and the centroid's σ.

    Size, lean, threshold height and noise come from the field's own blobs, spread and line jitter from the
    settings.

    Raises:
        InputError: The field has more than 1 bit.
    """
    meant_for(seen, "locale", (1,))
    centres = seen.centroids.copy()
    sigma_px = binary_sigma_px(seen.area_px, seen.packed.y_step, doubled=seen.packed.is_doubled)
    patterns = patterns_of(seen, centres)
    if not patterns.kinds:
        return Located(centres, sigma_px)
    spread_px, jitter_px = seen.settings.spread_px, seen.settings.line_jitter_px
    packed = seen.packed
    look = Appearance(
        1.0, 1.0, patterns.fraction, NOISES[0], spread_px, jitter_px, packed.y_step, packed.lines_apart
    )
    posterior = _posterior(patterns, look)
    explained = posterior.evidence > np.median(posterior.evidence) - UNEXPLAINED
    blob = patterns.blob[explained]
    stretched = patterns.stretched[explained]
    from_middle_px = posterior.from_middle_px[explained] / stretched
    centres[blob] = patterns.middle[explained] + from_middle_px / (1, seen.packed.y_step)
    variance = posterior.variance_px2[explained] / stretched**2
    variance[:, 0] -= np.minimum(_jitter_px2(seen, blob), MOST_JITTER * variance[:, 0])
    sigma_px[blob] = np.sqrt(variance)
    return Located(centres, sigma_px, discs=np.bincount(blob, minlength=len(centres)) > 0)


def _jitter_px2(seen: Seen, blob: NDArray[np.int64]) -> Array:
    """(M,) variance of x from line jitter, which is reported separately as the common error."""
    lines = math.sqrt(4 / math.pi) / 2 * np.sqrt(seen.area_px[blob]) / seen.packed.lines_apart
    common: Array = JITTER_OF_CENTRE * seen.settings.line_jitter_px**2 / lines
    return common * (JITTER_OF_DOUBLED_ENDS if seen.packed.is_doubled else JITTER_OF_ENDS)


def _posterior(patterns: Patterns, look: Appearance) -> Posterior:
    """Posterior with the noise that explains the field's blobs best."""
    grids = [Grid.of(*kind, look.y_step) for kind in patterns.kinds]
    entries = Entries.of(patterns.cuts, grids, patterns.blobs)
    blobs = min(patterns.blobs[0], NOISE_BLOBS)
    noise = _likeliest_noise(look.of_size(*patterns.kinds[0]), blobs, entries.first(blobs))
    look = look._replace(noise=noise)
    tables = [table(look.of_size(*kind)) for kind in patterns.kinds]
    return Posterior.of(likelihoods(tables, patterns.blobs, entries), look.y_step)


def _likeliest_noise(look: Appearance, blobs: int, entries: Entries) -> float:
    """The value of `NOISES` that explains blobs of the most frequent kind best."""
    tables = (table(look._replace(noise=noise)) for noise in NOISES)
    evidence = np.array([evidence_of(likelihoods([one], [blobs], entries)) for one in tables])
    # Blobs that are no targets must not decide.
    least = np.array([[np.median(one)] for one in evidence]) - UNEXPLAINED
    return NOISES[int(np.maximum(evidence, least).sum(axis=1).argmax())]
