"""Contact pressure as a function of a place: its slope, its reach, its shapes."""

from dataclasses import replace

import numpy as np
import pytest
from tools.liner_wall.designs import TEATS
from tools.liner_wall.teat import Teat, opposite_wall

SHAPES = [teat for teat in TEATS if teat is not None]


@pytest.mark.parametrize("teat", SHAPES, ids=lambda teat: teat.name)
def test_slope_is_that_of_the_pressure(teat: Teat) -> None:
    rng = np.random.default_rng(4)
    points = np.column_stack([rng.uniform(-30, 25, 200), rng.uniform(-11, 11, (200, 2))])
    _, slope = teat.pressure(points)
    step = 1e-6
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        numeric = (teat.pressure(points + shift)[0] - teat.pressure(points - shift)[0]) / (2 * step)
        np.testing.assert_allclose(slope[:, axis], numeric, rtol=1e-4, atol=1e-7)


@pytest.mark.parametrize("teat", SHAPES, ids=lambda teat: teat.name)
def test_nothing_is_pressed_outside_the_teat_and_more_the_deeper(teat: Teat) -> None:
    along = np.array([-20.0, 0.0, 0.0])
    outside = np.array([-20.0, 0.0, teat.radius_mm + 1.0])
    depths = np.linspace(0.5, 3.0, 6)
    inside = along + np.outer(teat.radius_mm - depths, [0.0, 0.0, 1.0])
    assert teat.pressure(outside)[0] == 0
    assert np.all(np.diff(teat.pressure(inside)[0]) > 0)
    assert teat.pressure(np.array([teat.end_x_mm + 0.5, 0.0, 0.0]))[0] == 0


def test_a_blunt_teat_is_wider_at_its_end_than_a_pointed_one() -> None:
    _, blunt, pointed = SHAPES

    def width_mm(teat: Teat) -> float:
        z = np.linspace(0, 12, 1201)
        near_end = np.column_stack([np.full_like(z, teat.end_x_mm - 2.0), np.zeros_like(z), z])
        return float(z[teat.pressure(near_end)[0] > 0].max(initial=0.0))

    assert width_mm(blunt) > width_mm(pointed) + 2


def test_opposite_walls_push_each_other_apart_where_they_meet() -> None:
    points = np.array([[0.0, 1.0, 0.5], [0.0, 1.0, -0.2]])
    pressure, slope = opposite_wall(points)
    assert pressure[0] == 0
    assert pressure[1] > 0.05
    assert slope[1, 2] < 0


def test_a_teat_that_is_moved_pushes_where_it_was_moved_to() -> None:
    centred = SHAPES[0]
    moved = replace(centred, y_mm=1.0, z_mm=-0.5)
    points = np.random.default_rng(5).uniform(-12, 12, (50, 3))
    for told, expected in zip(
        moved.pressure(points + np.array([0.0, 1.0, -0.5])), centred.pressure(points), strict=True
    ):
        np.testing.assert_allclose(told, expected, atol=1e-12)


def test_the_lower_half_is_pushed_down_where_the_upper_one_is_pushed_up() -> None:
    point = np.array([0.0, 1.0, -0.2])
    below, slope = opposite_wall(-point, -1.0)
    above, opposite = opposite_wall(point, 1.0)
    assert below == above > 0
    np.testing.assert_allclose(slope, -opposite)
    assert opposite_wall(point, -1.0)[0] == 0
