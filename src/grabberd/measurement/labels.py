"""Which runs belong together: connected components (paper 3.5)."""

import numpy as np
from numpy.typing import NDArray

from grabberd.measurement.runs import Runs


def label_runs(runs: Runs) -> tuple[NDArray[np.int64], int]:
    """The component of every run, and how many there are; diagonal neighbours are connected.

    Components are numbered from 0 in the order of their first row and column. Right for every shape: where a
    run has several neighbours in the row above (a U, a ring, a comb), the trees that meet there are united.

    Returns:
        (R,) int64 labels, and their number.
    """
    above, count = _neighbours_above(runs)
    own = np.arange(len(runs))
    parent = _roots(np.where(count > 0, above, own))
    several = np.flatnonzero(count > 1)
    if several.size:
        parent = _unite(parent, *_further_edges(several, above, count))
    is_root = parent == own
    return (np.cumsum(is_root) - 1)[parent], int(np.count_nonzero(is_root))


def _neighbours_above(runs: Runs) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The first run that touches each run in the row above it, and how many follow one another there."""
    stride = int(runs.last.max(initial=0)) + 3
    row_above = (runs.row - 1) * stride
    start, end = runs.row * stride + runs.first, runs.row * stride + runs.last
    first_touching = np.searchsorted(end, row_above + runs.first - 1)
    beyond = np.searchsorted(start, row_above + runs.last + 1, side="right")
    return first_touching, beyond - first_touching


def _roots(parent: NDArray[np.int64]) -> NDArray[np.int64]:
    """Every run's root, where each points to an earlier run or to itself; chains halve with every step."""
    while True:
        further = parent[parent]
        if np.array_equal(further, parent):
            return parent
        parent = further


def _further_edges(
    several: NDArray[np.int64], above: NDArray[np.int64], count: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The edges to the second and later neighbours above."""
    extra = count[several] - 1
    lower = np.repeat(several, extra)
    ordinal = np.arange(len(lower)) - np.repeat(np.cumsum(extra) - extra, extra)
    return lower, above[lower] + 1 + ordinal


def _unite(
    parent: NDArray[np.int64], lower: NDArray[np.int64], upper: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Roots after joining the ends of every edge: the later is hooked to the earlier until none differ."""
    while True:
        a, b = parent[lower], parent[upper]
        apart = a != b
        if not apart.any():
            return parent
        lower, upper, a, b = lower[apart], upper[apart], a[apart], b[apart]
        parent = parent.copy()
        np.minimum.at(parent, np.maximum(a, b), np.minimum(a, b))
        parent = _roots(parent)
