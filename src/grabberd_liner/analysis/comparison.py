"""Groups of captures compared, by their means and the difference of every two, and their trend over a
number: milkings, days, a pressure that is known; with the scatter of repeated captures against their own σ.
"""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc

from grabberd.core.arrays import Array
from grabberd_liner.analysis.mixed_model import (
    Contrast,
    Fit,
    Levels,
    Observations,
    cell_means,
    fit,
    identifiable,
    levels_of,
)


class ScatterCheck(NamedTuple):
    """Test of whether repetitions differ by their own σ alone.

    Attributes:
        chi2: weighted square of the departures; about `dof` if they do.
        dof: degrees of freedom; 0 where nothing was repeated, or a σ is not known.
        p: probability of a larger one if they do; NaN without freedom.
    """

    chi2: float
    dof: int
    p: float


def scatter_check(observed: Observations, design: Array, effects: Sequence[Levels] = ()) -> ScatterCheck:
    """Compare the departures from a model with the observations' own σ.

    Args:
        observed: N values.
        design: (N, P) the model's columns.
        effects: (N,) levels of what may differ besides.
    """
    if not (observed.own > 0).all() or (observed.unsplit > 0).any():
        return ScatterCheck(np.nan, 0, np.nan)
    columns = [design, *((levels[:, None] == np.unique(levels)) * 1.0 for levels in effects)]
    weighted = np.hstack(columns) / observed.own[:, None]
    value = observed.value / observed.own
    solution, _, rank, _ = np.linalg.lstsq(weighted, value, rcond=None)
    dof = len(value) - int(rank)
    if dof == 0:
        return ScatterCheck(np.nan, 0, np.nan)
    chi2 = float(np.sum(np.square(value - weighted @ solution)))
    return ScatterCheck(chi2, dof, float(chdtrc(dof, chi2)))


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
        between_sigma: standard deviation between blocks; NaN without them or if it cannot be estimated.
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


class Line(NamedTuple):
    """A straight line through a quantity over x.

    Attributes:
        offset: the quantity at x = 0.
        slope: its change with x, per unit of x.
    """

    offset: Contrast
    slope: Contrast


class Trend(NamedTuple):
    """A quantity over x in G groups, each with an offset of its own.

    Attributes:
        common: slope that all groups share.
        slopes: slope of each group; None for a group whose x are all the same.
    """

    common: Contrast
    slopes: tuple[Contrast | None, ...]


def straight_line(observed: Observations, x: Array) -> Line:
    """A straight line through N observations.

    Args:
        observed: N values.
        x: (N,) where; at least two different ones.

    Raises:
        ValueError: all x are the same.
    """
    means, at, effects, _ = _replicates(observed, x, np.zeros(len(x), np.int64), None, None)
    scale = _scale(at)
    design = np.column_stack([np.ones_like(at), at / scale])
    fitted = _fit(means, design, effects)
    return Line(fitted.contrast(np.array([1.0, 0.0])), fitted.contrast(np.array([0.0, 1.0 / scale])))


def trend(
    observed: Observations,
    x: Array,
    group: Levels,
    unit: Levels | None = None,
    block: Levels | None = None,
) -> Trend:
    """Slopes over x, for all groups together and for each by itself.

    Args:
        observed: N values.
        x: (N,) where.
        group: (N,) group of each, from 0.
        unit: (N,) what is averaged where it was observed several times at the same x, and keeps a departure
            of its own; default: every capture by itself.
        block: (N,) what several groups have in common.

    Raises:
        ValueError: no group has two different x.
    """
    means, at, effects, groups = _replicates(observed, x, group, unit, block)
    inside = (groups[:, None] == np.arange(int(group.max()) + 1)) * 1.0
    centred = at - inside @ (inside.T @ at / inside.sum(axis=0))
    scale = _scale(centred)
    centred /= scale
    count = inside.shape[1]
    has_slope = [bool(np.ptp(at[groups == one]) > 0) for one in range(count)]
    common = _fit(means, np.column_stack([inside, centred]), effects)
    each = _fit(means, np.column_stack([inside, (inside * centred[:, None])[:, has_slope]]), effects)
    places = iter(np.eye(count + sum(has_slope))[count:] / scale)
    slopes = tuple(each.contrast(next(places)) if one else None for one in has_slope)
    return Trend(common.contrast(np.eye(count + 1)[count] / scale), slopes)


def _scale(x: Array) -> float:
    """Size of x, by which it is divided: milkings and days are far from the indicators of groups."""
    return float(np.abs(x).max()) or 1.0


def _replicates(
    observed: Observations, x: Array, group: Levels, unit: Levels | None, block: Levels | None
) -> tuple[Observations, Array, list[Levels], Levels]:
    """Replicates with their x, effects and groups: what a unit has at one x is averaged."""
    ones = unit if unit is not None else np.arange(len(x))
    blocks = block if block is not None else np.zeros_like(group)
    names = list(zip(group.tolist(), blocks.tolist(), ones.tolist(), x.tolist(), strict=True))
    cell = levels_of(names)
    first = np.unique(cell, return_index=True)[1]
    within = levels_of([(names[k][0], names[k][2]) for k in first])
    effects = [one for one, given in ((blocks[first], block), (within, unit)) if given is not None]
    return cell_means(observed, cell), x[first], effects, group[first]


def _fit(observed: Observations, design: Array, effects: list[Levels]) -> Fit:
    return fit(observed, design, [effects[number] for number in identifiable(design, effects)])
