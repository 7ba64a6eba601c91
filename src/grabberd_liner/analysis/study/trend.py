"""A quantity over a number: milkings, days, a pressure that is known."""

from typing import NamedTuple

import numpy as np

from grabberd_liner.analysis.study.contrast import Contrast
from grabberd_liner.analysis.study.mixed_model import Fit, fit, identifiable
from grabberd_liner.analysis.study.observations import Array, Levels, Observations, cell_means, levels_of
from grabberd_liner.analysis.study.scatter import ScatterCheck, scatter_check


class Line(NamedTuple):
    """A straight line through a quantity over x.

    Attributes:
        offset: the quantity at x = 0.
        slope: its change with x, per unit of x.
        residual_sigma: standard deviation of the replicates about the line; NaN if there are only two.
        check: scatter of the captures about the line against their own σ.
    """

    offset: Contrast
    slope: Contrast
    residual_sigma: float
    check: ScatterCheck


class Trend(NamedTuple):
    """A quantity over x in G groups, each with an offset of its own.

    Attributes:
        common: slope that all groups share.
        slopes: slope of each group; None for a group whose x are all the same.
        replicates: how many independent values there are.
        residual_sigma: standard deviation of the replicates about the lines with slopes of their own.
        check: scatter of the captures about those lines against their own σ.
    """

    common: Contrast
    slopes: tuple[Contrast | None, ...]
    replicates: int
    residual_sigma: float
    check: ScatterCheck


def straight_line(observed: Observations, x: Array, unit: Levels | None = None) -> Line:
    """A straight line through N observations.

    Args:
        observed: N values.
        x: (N,) where; at least two different ones.
        unit: (N,) what is observed at several x and keeps a departure of its own; default: none.

    Raises:
        ValueError: all x are the same.
    """
    means, at, effects, _ = _replicates(observed, x, np.zeros(len(x), np.int64), unit, None)
    scale = _scale(at)
    design = np.column_stack([np.ones_like(at), at / scale])
    fitted = _fit(means, design, effects)
    check = scatter_check(observed, np.column_stack([np.ones_like(x), x]), [] if unit is None else [unit])
    return Line(
        fitted.contrast(np.array([1.0, 0.0])),
        fitted.contrast(np.array([0.0, 1.0 / scale])),
        _residual(fitted),
        check,
    )


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
    own_lines = np.column_stack([*_indicators(group, count), *(_indicators(group, count) * x)])
    check = scatter_check(observed, own_lines, [one for one in (unit, block) if one is not None])
    return Trend(common.contrast(np.eye(count + 1)[count] / scale), slopes, len(at), _residual(each), check)


def _scale(x: Array) -> float:
    """Size of x, by which it is divided: milkings and days are far from the indicators of groups."""
    return float(np.abs(x).max()) or 1.0


def _indicators(group: Levels, count: int) -> Array:
    return np.asarray((group[None, :] == np.arange(count)[:, None]) * 1.0)


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


def _residual(fitted: Fit) -> float:
    return float(np.sqrt(fitted.variances[0])) if len(fitted.variances) else np.nan
