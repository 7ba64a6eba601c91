"""The smoothing of each part of the stroke."""

import numpy as np
import pytest

from core.chain.milking import CLOSED_S, changed, grid, still
from grabberd.errors import AnalysisError
from grabberd_liner.chain.analysis.wall_series import LEVELS, Smoothings


def of(fields):
    return Smoothings.of(grid(), [one.timed.points for one in fields])


def test_open_and_closed_walls_have_their_own() -> None:
    opened, closed = still(3), still(3, CLOSED_S)
    chosen = of([*opened, *closed])
    assert len(chosen.choices) == LEVELS
    assert len(chosen.limits_mm) == LEVELS - 1
    assert chosen.for_points(opened[0].timed.points) is chosen.choices[0]
    assert chosen.for_points(closed[0].timed.points) is chosen.choices[-1]


def test_every_field_has_one_even_where_the_wall_never_moves() -> None:
    fields = still(3)
    chosen = of(fields)
    assert all(np.isfinite(chosen.for_points(one.timed.points).along_mm) for one in fields)


def test_fields_without_points_do_not_count() -> None:
    fields = still(3)
    empty = changed(fields[0], keep=np.zeros(35, bool))
    assert np.isfinite(of([*fields, empty]).limits_mm).all()
    with pytest.raises(AnalysisError, match="no points in 1 fields"):
        of([empty])
