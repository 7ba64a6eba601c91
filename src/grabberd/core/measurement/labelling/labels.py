"""Connected components of runs (paper 3.5)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.measurement.labelling.runs import Runs

SHORT = 1 << 16
"""Values below this fit 16 bits, which numpy sorts by radix."""


class _Above(NamedTuple):
    """Neighbours of every run in the row above.

    Attributes:
        first: (R,) int64, the first run reaching at least the column left of it.
        touches: (R,) bool, True if that run touches it.
        several: (S,) int64, the few runs touched by further ones.
        touching: (S,) int64, the number of runs touching each of those.
    """

    first: NDArray[np.int64]
    touches: NDArray[np.bool_]
    several: NDArray[np.int64]
    touching: NDArray[np.int64]


def label_runs(runs: Runs) -> tuple[NDArray[np.int64], int]:
    """Label the component of every run; diagonal neighbours are connected.

    Components are numbered from 0 in the order of their first row and column. Correct for every shape: where
    a run has several neighbours in the row above (a U, a ring, a comb), the trees meeting there are merged.

    Returns:
        (R,) int64 labels, and the number of components.
    """
    above = _neighbours_above(runs)
    own = np.arange(len(runs.row))
    parent = _roots(np.where(above.touches, above.first, own))
    if above.several.size:
        parent = _unite(parent, *_further_edges(above))
    is_root = parent == own
    return (np.cumsum(is_root) - 1)[parent], int(np.count_nonzero(is_root))


def by_component(runs: Runs) -> tuple[Runs, NDArray[np.int64], int]:
    """Sort runs by component, row and column; return them with their labels and the number of components."""
    label, count = label_runs(runs)
    order = short(label, count).argsort(kind="stable")
    return runs.taken(order), label[order], count


def short(values: NDArray[np.int64], end: int) -> NDArray[np.integer]:
    """Convert values from 0 to below `end` to a type that numpy sorts six times faster, if they fit."""
    return values.astype(np.uint16) if end <= SHORT else values


def _neighbours_above(runs: Runs) -> _Above:
    # Rows lie farther apart than they are long, so diagonal neighbours never reach round a row's end.
    stride = int(runs.last.max(initial=0)) + 3
    begin = runs.row * stride
    start, end = begin + runs.first, begin + runs.last
    reach = end - (stride - 1)
    first = end.searchsorted(start - (stride + 1))
    start_or_none = np.append(start, np.iinfo(np.int64).max)
    several = (start_or_none[first + 1] <= reach).nonzero()[0]
    touching = start.searchsorted(reach[several], side="right") - first[several]
    return _Above(first, start_or_none[first] <= reach, several, touching)


def _roots(parent: NDArray[np.int64]) -> NDArray[np.int64]:
    """Find every run's root, where each points to an earlier run or itself; chains halve with every step."""
    while True:
        further = parent[parent]
        if (further == parent).all():
            return parent
        parent = further


def _further_edges(above: _Above) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Edges to the second and later neighbours above."""
    extra = above.touching - 1
    lower = np.repeat(above.several, extra)
    ordinal = np.arange(len(lower)) - np.repeat(np.cumsum(extra) - extra, extra)
    return lower, above.first[lower] + 1 + ordinal


def _unite(
    parent: NDArray[np.int64], lower: NDArray[np.int64], upper: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Join the ends of every edge by hooking the later root to the earlier, until none differ."""
    while True:
        a, b = parent[lower], parent[upper]
        apart = a != b
        if not apart.any():
            return parent
        lower, upper, a, b = lower[apart], upper[apart], a[apart], b[apart]
        # minimum.at: several edges may hook the same root, and the earliest of them must win.
        parent = parent.copy()
        np.minimum.at(parent, np.maximum(a, b), np.minimum(a, b))
        parent = _roots(parent)
