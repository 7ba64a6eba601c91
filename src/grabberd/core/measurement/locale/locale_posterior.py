"""Posterior of blobs' positions given their bits."""

from collections.abc import Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.measurement.locale.locale_patterns import Cuts
from grabberd.core.measurement.locale.locale_table import Grid, Table, moments

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Whole = NDArray[np.int64]


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
    evidence: Array = greatest + np.log(weight.sum(axis=1, dtype=np.float64))
    return evidence


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
