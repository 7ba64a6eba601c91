"""States of a solved wall, between its nodes and its pressures."""

import numpy as np
import pytest

from grabberd_fake.wall_states import Patch, WallStates, quadratic_weights, wall_names, wall_states

ROWS_MM = np.linspace(-50.0, 50.0, 9)
ROUND = np.linspace(-1.2, 1.2, 6)
SLACK_MM = 0.25
"""A mounted wall leaves the cylinder by its oval and by where its teat is wider than its bore."""


@pytest.fixture(params=wall_names())
def states(request: pytest.FixtureRequest) -> WallStates:
    return wall_states(request.param)


def height_mm(states: WallStates, outer_kpa: float) -> float:
    """Of the wall's upper side in the middle of its length."""
    points, _ = Patch(states, np.array([0.0]), np.array([0.0])).surface(states.outer_mm(outer_kpa))
    return float(points[0, 0, 2])


def test_the_reference_liner_is_there_on_every_teat() -> None:
    assert {f"reference-{teat}" for teat in ("empty", "round", "blunt", "pointed")} <= set(wall_names())


def test_quadratic_elements_reproduce_a_parabola_and_its_slope() -> None:
    nodes = np.linspace(-3.0, 5.0, 9)
    at = np.array([-3.0, -1.3, 0.0, 2.2, 5.0])
    weights, slopes = quadratic_weights(nodes, at)
    np.testing.assert_allclose(weights @ (2 * nodes**2 - nodes), 2 * at**2 - at, atol=1e-12)
    np.testing.assert_allclose(slopes @ (2 * nodes**2 - nodes), 4 * at - 1, atol=1e-12)


def test_the_mounted_wall_is_all_but_a_cylinder(states: WallStates) -> None:
    design = states.about["design"]
    radius_mm = design["radius_mm"] + design["wall_mm"] / 2 - design["taper"] * states.x_mm
    mounted = states.outer_mm(0.0)
    off_mm = np.hypot(mounted[..., 1], mounted[..., 2]) - radius_mm[:, np.newaxis]
    teat = states.about["teat"] or {}
    pushed_aside_mm = abs(teat.get("y_mm", 0.0)) + abs(teat.get("z_mm", 0.0))
    assert np.abs(off_mm).max() < SLACK_MM + pushed_aside_mm


def test_the_wall_closes_as_the_pressure_rises(states: WallStates) -> None:
    heights = [height_mm(states, kpa) for kpa in (0, 15, 25, 40)]
    assert np.all(np.diff(heights) < 0.05), "a wall that is closed stays so"
    assert heights[-1] < 0.8 * heights[0]


def test_a_teat_is_pressed_and_no_teat_only_where_walls_meet(states: WallStates) -> None:
    contact = states.contact_kpa(42.0)
    assert contact.min() >= 0
    assert 5 < contact.max() < 250
    assert states.force_n_per_mm(42.0).max() > 0.1
    if states.about["teat"] is None:
        assert states.contact_kpa(2.0).max() == 0


def test_no_teat_pulls_where_contact_begins(states: WallStates) -> None:
    for outer_kpa in np.arange(8.0, 20.0, 0.1):
        assert states.contact_kpa(outer_kpa).min() >= 0
        assert states.force_n_per_mm(outer_kpa).min() >= 0


def test_normals_stand_on_the_surface_and_point_outward(states: WallStates) -> None:
    grid = states.outer_mm(20.0)
    points, normals = Patch(states, ROWS_MM, ROUND).surface(grid)
    beside, _ = Patch(states, ROWS_MM + 1e-4, ROUND).surface(grid)
    round_, _ = Patch(states, ROWS_MM, ROUND + 1e-5).surface(grid)
    for other in (beside, round_):
        step = other - points
        step /= np.linalg.norm(step, axis=-1, keepdims=True)
        assert np.abs((step * normals).sum(axis=-1)).max() < 1e-3
    from_axis = points * [0.0, 1.0, 1.0]
    assert (from_axis * normals).sum(axis=-1).min() > 0


def test_parts_that_were_not_solved_mirror_those_that_were(states: WallStates) -> None:
    grid = states.outer_mm(20.0)
    one, _ = Patch(states, ROWS_MM, np.array([0.4, np.pi - 0.4])).surface(grid)
    other, _ = Patch(states, ROWS_MM, np.array([-0.4, 0.4 - np.pi])).surface(grid)
    teat = states.about["teat"] or {}
    flanks_differ = np.abs(other - one * [1, -1, 1]).max()
    sides_differ = np.abs(one[:, 1] - one[:, 0] * [1, 1, -1]).max()
    assert (flanks_differ < 1e-9) == (not teat.get("y_mm"))
    assert (sides_differ < 1e-9) == (not teat.get("z_mm"))


def test_surface_goes_on_smoothly_from_a_solved_part_into_a_mirrored_one(states: WallStates) -> None:
    close = np.array([-1e-4, 1e-4])
    for border in (0.0, np.pi / 2, -np.pi / 2):
        points, normals = Patch(states, ROWS_MM, border + close).surface(states.outer_mm(20.0))
        assert np.abs(points[:, 1] - points[:, 0]).max() < 0.01
        assert (normals[:, 1] * normals[:, 0]).sum(axis=-1).min() > 0.99


def test_an_unknown_wall_is_refused_with_the_names_there_are() -> None:
    with pytest.raises(ValueError, match="no wall is named 'x'; there are reference-blunt, "):
        WallStates("x")
