"""Groups of captures compared: their means, and the difference of every two."""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from grabberd_liner.analysis.study.contrast import Contrast
from grabberd_liner.analysis.study.mixed_model import Fit, fit, identifiable
from grabberd_liner.analysis.study.observations import Levels, Observations, cell_means, levels_of
from grabberd_liner.analysis.study.scatter import ScatterCheck, scatter_check


class Difference(NamedTuple):
    """The mean of group `second` less that of group `first`; `adjusted_p` is Holm's over all pairs."""

    first: int
    second: int
    found: Contrast
    adjusted_p: float


class Comparison(NamedTuple):
    """G groups.

    Attributes:
        means: of each group.
        captures: how many captures each group has.
        replicates: number of independent values after averaging by unit.
        differences: of every two groups.
        paired: True if differences are those within blocks.
        between_sigma: standard deviation between blocks; NaN without them or if none can be told.
        within_sigma: standard deviation between replicates, within blocks; NaN if there is only one each.
        check: scatter of the captures against their own σ.
    """

    means: tuple[Contrast, ...]
    captures: tuple[int, ...]
    replicates: tuple[int, ...]
    differences: tuple[Difference, ...]
    paired: bool
    between_sigma: float
    within_sigma: float
    check: ScatterCheck


def compare(
    observed: Observations, group: Levels, unit: Levels | None = None, block: Levels | None = None
) -> Comparison:
    """Compare groups.

    Args:
        observed: N values.
        group: (N,) group of each, from 0; every group has one at least.
        unit: (N,) what counts as one independent replicate within its group, and is averaged; default: the
            block in the group, or without blocks every capture.
        block: (N,) what has several groups, so that they are compared within it.
    """
    count = int(group.max()) + 1
    unit = unit if unit is not None else block if block is not None else np.arange(len(group))
    blocks = block if block is not None else np.zeros_like(group)
    cell = levels_of(list(zip(group.tolist(), blocks.tolist(), unit.tolist(), strict=True)))
    first = np.unique(cell, return_index=True)[1]
    means, groups = cell_means(observed, cell), group[first]
    design = (groups[:, None] == np.arange(count)) * 1.0
    effects = [blocks[first]] if block is not None else []
    effects = [effects[number] for number in identifiable(design, effects)]
    fitted = fit(means, design, effects)
    # In a mean over few cows their scatter is nearly all: Satterthwaite would trust a small one too much.
    most_dof = len(np.unique(effects[0])) - 1 if effects else np.inf
    return Comparison(
        tuple(fitted.contrast(row, most_dof) for row in np.eye(count)),
        tuple(np.bincount(group, minlength=count).tolist()),
        tuple(np.bincount(groups, minlength=count).tolist()),
        _differences(fitted, count),
        bool(effects),
        _sigma(fitted, 1),
        _sigma(fitted, 0),
        _check(observed, group, cell, block),
    )


def holm(p: Sequence[float]) -> list[float]:
    """Probabilities of several tests, adjusted for their number after Holm; NaN are no tests."""
    adjusted, known, floor = [np.nan] * len(p), [k for k, one in enumerate(p) if np.isfinite(one)], 0.0
    for rank, k in enumerate(sorted(known, key=lambda k: p[k])):
        floor = max(floor, min((len(known) - rank) * p[k], 1.0))
        adjusted[k] = floor
    return adjusted


def _differences(fitted: Fit, count: int) -> tuple[Difference, ...]:
    unit = np.eye(count)
    pairs = list(combinations(range(count), 2))
    found = [fitted.contrast(unit[second] - unit[first]) for first, second in pairs]
    adjusted = holm([one.p for one in found])
    return tuple(Difference(*pair, one, p) for pair, one, p in zip(pairs, found, adjusted, strict=True))


def _check(observed: Observations, group: Levels, cell: Levels, block: Levels | None) -> ScatterCheck:
    """The scatter of the closest repetitions: within cells that have several captures, else within groups."""
    repeated = int(cell.max()) + 1 < len(cell)
    effects = [cell] if repeated else [] if block is None else [block]
    return scatter_check(observed, (group[:, None] == np.unique(group)) * 1.0, effects)


def _sigma(fitted: Fit, number: int) -> float:
    if number >= len(fitted.variances):
        return np.nan
    return float(np.sqrt(max(fitted.variances[number], 0.0)))
