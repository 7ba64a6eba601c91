"""Half tubes: what a quarter gives where the teat stands in the middle, and more where it does not."""

from dataclasses import replace

import numpy as np
import pytest
from tools.liner_wall.designs import (
    DESIGNS,
    OFF_CENTRE,
    QUARTER,
    RIGHT_HALF,
    TEATS,
    UPPER_HALF,
    Case,
    mounted,
)
from tools.liner_wall.mesh import Array
from tools.liner_wall.table import force_n_per_mm

WIDE = replace(TEATS[1], radius_mm=11.0)
"""Fills the bore: it is pressed before the liner buckles, so one step of pressure shows all there is."""
CENTRED = Case(DESIGNS[0], WIDE)
PRESSURE_MPA = 0.006


def solved(case: Case, sector: tuple[float, float]) -> tuple[Array, Array, Array]:
    """Places (N, 3) in block coordinates and in space, and the load per height."""
    tube, state = mounted(case.design, fineness=0.3, sector=sector)
    push = case.push(tube.mesh.inner_angles())
    nodes_mm = tube.solve(state, PRESSURE_MPA, push).nodes_mm
    return tube.mesh.block, nodes_mm, force_n_per_mm(tube, nodes_mm, push)


@pytest.fixture(scope="module")
def quarter() -> tuple[Array, Array, Array]:
    return solved(CENTRED, QUARTER)


@pytest.mark.parametrize("sector", [UPPER_HALF, RIGHT_HALF], ids=["upper", "right"])
def test_half_of_a_tube_on_a_centred_teat_is_two_quarters(
    sector: tuple[float, float], quarter: tuple[Array, Array, Array]
) -> None:
    block, nodes_mm, load = solved(CENTRED, sector)
    in_quarter = (block[:, 0] > -1e-9) & (block[:, 0] < np.pi / 2 + 1e-9)
    np.testing.assert_allclose(block[in_quarter], quarter[0], atol=1e-9)
    np.testing.assert_allclose(nodes_mm[in_quarter], quarter[1], atol=1e-3)
    np.testing.assert_allclose(load, quarter[2], rtol=1e-3, atol=2e-5)
    mirror = np.array([1.0, -1.0, 1.0] if sector is UPPER_HALF else [1.0, 1.0, -1.0])
    other = (-block[:, 0] if sector is UPPER_HALF else np.pi - block[:, 0]).round(6)
    order, opposite = (
        np.lexsort((block[:, 1], block[:, 2], angle)) for angle in (block[:, 0].round(6), other)
    )
    np.testing.assert_allclose(nodes_mm[order], nodes_mm[opposite] * mirror, atol=1e-3)


def test_quarter_is_in_contact_where_the_halves_are_compared(quarter: tuple[Array, Array, Array]) -> None:
    assert quarter[2].max() > 0.05


@pytest.mark.parametrize(
    ("teat", "axis"), [(OFF_CENTRE[0], 1), (OFF_CENTRE[1], 2)], ids=["across", "towards"]
)
def test_teat_beside_the_axis_pushes_the_wall_to_its_side(teat, axis: int) -> None:
    case = Case(DESIGNS[0], replace(teat, radius_mm=11.0))
    block, nodes_mm, _ = solved(case, case.sector)
    opposed = (0.0, np.pi) if axis == 2 else (-np.pi / 2, np.pi / 2)
    outer_at_teat = np.isclose(block[:, 1], 1.0) & (block[:, 2] < 0.5)
    sides = [nodes_mm[outer_at_teat & np.isclose(block[:, 0], angle), axis] for angle in opposed]
    assert (sides[0] + sides[1]).max() > 0.1
    assert (sides[0] + sides[1]).min() > -0.01


def test_teat_moved_both_ways_is_refused() -> None:
    askew = Case(DESIGNS[0], replace(OFF_CENTRE[0], z_mm=1.0))
    with pytest.raises(ValueError, match="reference-round-across: the teat is moved both ways"):
        _ = askew.sector
