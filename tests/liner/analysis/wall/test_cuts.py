"""Constraints of the half tube: mirrored and clamped, with cuts that can be shifted, turned and pushed."""

import numpy as np
import pytest

from grabberd_liner.analysis.wall.half_tube import Cuts, cut_points
from grabberd_liner.analysis.wall.splines import SplineAxis, SplineGrid

GRID = SplineGrid(SplineAxis.over(-20.0, 20.0, 5), SplineAxis.over(-30.0, 30.0, 6))
CUTS = Cuts.of(GRID)
X = np.linspace(-30.0, 30.0, 13)
LOW, HIGH = (GRID.basis(np.full(13, s), X) for s in (-20.0, 20.0))
S = np.linspace(-20.0, 20.0, 11)
ENDS = [GRID.basis(S, np.full(11, x)) for x in (-30.0, 30.0)]
AROUND, ALONG = 1, 2


def any_free():
    unknowns = np.random.default_rng(1).normal(size=CUTS.count)
    return (CUTS.free @ unknowns).reshape(-1, 4)


def along_cut(values):
    """Spline along the tube with control values on the inner points of a cut."""
    control = np.zeros(GRID.along.count)
    control[cut_points(GRID)] = values
    control = np.repeat(control, GRID.around.count)
    return LOW.of(control)


@pytest.mark.parametrize("cut", [LOW, HIGH], ids=["low", "high"])
def test_a_wall_that_is_free_to_move_stays_its_own_mirror_image_at_a_cut(cut):
    moved = any_free()
    assert cut.of(moved)[:, 2] == pytest.approx(np.zeros(13), abs=1e-12)
    assert cut.of(moved, AROUND)[:, [0, 1, 3]] == pytest.approx(np.zeros((13, 3)), abs=1e-12)
    assert np.abs(cut.of(moved)[6, [0, 1, 3]]).min() > 1e-3


@pytest.mark.parametrize("end", ENDS, ids=["low", "high"])
def test_an_end_is_clamped_and_may_stretch(end):
    moved = any_free()
    assert end.of(moved) == pytest.approx(np.zeros((11, 4)), abs=1e-12)
    assert end.of(moved, ALONG)[:, 1:] == pytest.approx(np.zeros((11, 3)), abs=1e-12)
    assert np.abs(end.of(moved, ALONG)[:, 0]).max() > 1e-3


def test_each_control_value_is_held_or_follows_one_unknown():
    order = CUTS.order.ravel()
    free = order >= 0
    assert np.array_equal(np.unique(order[free]), np.arange(CUTS.count))
    unknowns = np.random.default_rng(2).normal(size=CUTS.count)
    assert np.array_equal((CUTS.free @ unknowns)[free], unknowns[order[free]])
    assert not (CUTS.free @ unknowns)[~free].any()


def test_points_of_a_cut_that_may_move_leave_the_clamped_ends_out():
    assert np.array_equal(cut_points(GRID), np.arange(2, GRID.along.count - 2))


def test_a_shift_moves_its_own_cut_towards_the_cameras():
    size = len(cut_points(GRID))
    shift = np.random.default_rng(3).normal(size=size)
    low, high = (np.zeros(4 * size) for _ in range(2))
    low[:size], high[size : 2 * size] = shift, shift
    for values, moving, still in ((low, LOW, HIGH), (high, HIGH, LOW)):
        moved = (CUTS.moved @ values).reshape(-1, 4)
        assert moving.of(moved)[:, 2] == pytest.approx(along_cut(shift))
        assert not still.of(moved).any()


def test_a_turn_is_the_slope_of_y_at_its_own_cut():
    size = len(cut_points(GRID))
    turns = np.random.default_rng(4).normal(size=2 * size)
    moved = (CUTS.moved @ np.concatenate([np.zeros(2 * size), turns])).reshape(-1, 4)
    assert LOW.of(moved, AROUND)[:, 1] == pytest.approx(along_cut(turns[:size]))
    assert HIGH.of(moved, AROUND)[:, 1] == pytest.approx(along_cut(turns[size:]))


def test_a_constant_force_on_a_cut_does_its_work_on_y():
    size = len(cut_points(GRID))
    unknowns = np.random.default_rng(5).normal(size=CUTS.count)
    moved = (CUTS.free @ unknowns).reshape(-1, 4)
    local, weights = np.polynomial.legendre.leggauss(3)
    x = (np.arange(-25.0, 30.0, 10.0)[:, np.newaxis] + 5 * local).ravel()
    for cut, s in enumerate((-20.0, 20.0)):
        force = np.zeros(2 * size)
        force[cut * size : (cut + 1) * size] = 0.3
        y = GRID.basis(np.full(len(x), s), x).of(moved)[:, 1]
        work = 0.3 * np.tile(5 * weights, 6) @ y
        assert unknowns @ (CUTS.forced @ force) == pytest.approx(work)
