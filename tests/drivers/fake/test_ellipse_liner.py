"""The ellipse, a wall that moves as prescribed."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from grabberd_fake import liner as ellipse
from grabberd_fake.liner import EllipseLiner, Sections, closure, profile
from grabberd_fake.liner_options import EllipseOptions

OPEN_NS, CLOSED_NS = 400_000_000, 900_000_000
times = st.integers(0, 3_000_000_000)
liner = EllipseLiner(EllipseOptions())


def test_it_has_18_rows_of_6_targets_numbered_from_one() -> None:
    assert liner.ids.tolist() == list(range(1, 109))
    assert (liner.row.max(), liner.column.max()) == (17, 5)
    assert (liner.row[6], liner.column[6]) == (1, 0)


def test_open_it_is_a_tube_with_targets_on_its_outer_face() -> None:
    targets = liner.targets(OPEN_NS)
    y, z = targets.xyz_mm[:, 1], targets.xyz_mm[:, 2] + 9.0
    assert_allclose(np.hypot(y, z), 13.75, atol=1e-6)
    assert_allclose(targets.normal, np.column_stack([0 * y, y, z]) / 13.75, atol=1e-6)
    assert_allclose(targets.xyz_mm, liner.nominal().xyz_mm, atol=1e-9)


def test_closed_its_middle_is_flattened_toward_the_cameras_and_wider_along_y() -> None:
    opened, closed = liner.wall(OPEN_NS).xyz_mm, liner.wall(CLOSED_NS).xyz_mm
    middle = (liner.row == 8) & (liner.column == 3)
    assert 4.2 < (opened - closed)[middle][0, 2] < 5.0
    assert closed[:, 1].max() > opened[:, 1].max() + 1
    assert_allclose(closed[:, 0], opened[:, 0])


def test_the_collapse_fades_towards_the_ends() -> None:
    moved = np.linalg.norm(liner.targets(CLOSED_NS).xyz_mm - liner.targets(OPEN_NS).xyz_mm, axis=1)
    by_row = moved.reshape(18, 6).max(axis=1)
    assert (np.diff(by_row[:9]) > 0).all()
    assert_allclose(by_row, by_row[::-1], atol=1e-9)
    assert by_row[0] < 0.35


def test_the_collapse_profile_is_one_in_the_middle_and_smooth_at_the_ends() -> None:
    x = np.array([-80.0, -65.0, -64.999, 0.0, 65.0])
    value, slope = profile(x, 130.0)
    assert_allclose(value, [0, 0, 0, 1, 0], atol=1e-8)
    assert_allclose(slope, 0, atol=1e-5)


COLUMNS = np.arange(6, dtype=np.int32)
AROUND = np.arange(13, dtype=np.int32)
sections = Sections(12.5, tuple(np.arange(-2.5, 3) * 6.5))
whole_sections = Sections(12.5, tuple(np.linspace(-np.pi, np.pi, 13) * 12.5))


@given(times)
def test_neighbours_round_the_wall_stay_one_pitch_apart_along_the_middle_surface(time_ns: int) -> None:
    deflection = 5.0 * closure(EllipseOptions(), time_ns)
    y, z = sections.at(np.full(6, deflection), COLUMNS)[:2]
    p = 12.5 - deflection
    q = 12.5 * ellipse.widened(np.array([p / 12.5]))[0]
    theta = np.arctan2(y / q, z / p)
    for start, end in pairwise(theta):
        way = np.linspace(start, end, 400)
        assert np.hypot(np.diff(q * np.sin(way)), np.diff(p * np.cos(way))).sum() == pytest.approx(
            6.5, abs=1e-4
        )


@given(st.floats(0, 8.7))
def test_every_cross_section_is_an_ellipse_of_the_open_ones_perimeter(deflection: float) -> None:
    y, z = whole_sections.at(np.full(13, deflection), AROUND)[:2]
    p, q = 12.5 - deflection, 12.5 * ellipse.widened(np.array([1 - deflection / 12.5]))[0]
    assert_allclose((y / q) ** 2 + (z / p) ** 2, 1, atol=1e-6)
    assert_allclose(ellipse.perimeter(np.array([p]), np.array([q])), 2 * np.pi * 12.5, rtol=1e-12)
    assert_allclose([y[0], z[0]], [-y[-1], z[-1]], atol=1e-6)
    assert z[6] == pytest.approx(p, abs=1e-6)


@given(st.floats(0.1, 8.6))
def test_the_derivatives_by_the_deflection_are_those_of_the_places(deflection: float) -> None:
    before, here, after = (sections.at(np.full(6, deflection + d), COLUMNS) for d in (-0.01, 0.0, 0.01))
    assert_allclose(here[2:4], (after[:2] - before[:2]) / 0.02, atol=2e-3)


@given(times)
def test_normals_are_perpendicular_to_the_surface_and_point_outward(time_ns: int) -> None:
    wall = liner.wall(time_ns)
    assert_allclose(np.linalg.norm(wall.normal, axis=1), 1, atol=1e-9)
    for tangent in (wall.along_s, wall.along_x):
        assert_allclose(np.einsum("nx,nx->n", wall.normal, tangent), 0, atol=1e-7)
    assert (np.einsum("nx,nx->n", wall.normal, wall.xyz_mm - [0, 0, -9.0])[:] > 0).all()


def test_the_tangent_along_the_tube_is_the_derivative_of_the_place() -> None:
    closed = liner.wall(CLOSED_NS)
    finer = EllipseLiner(EllipseOptions(rows=3, pitch_mm=6.5, columns=6))
    place, tangent = finer.wall(CLOSED_NS).xyz_mm, finer.wall(CLOSED_NS).along_x
    assert_allclose(tangent[6:12, 1:], 0, atol=1e-12)
    x = liner.row.reshape(18, 6)[:, 0] * 6.5 - 55.25
    for column in range(6):
        numeric = np.gradient(closed.xyz_mm.reshape(18, 6, 3)[:, column], x, axis=0, edge_order=2)
        assert_allclose(closed.along_x.reshape(18, 6, 3)[1:-1, column], numeric[1:-1], atol=0.005)
    assert place.shape == (18, 3)


@given(times)
def test_it_pulsates(time_ns: int) -> None:
    assert_allclose(liner.targets(time_ns).xyz_mm, liner.targets(time_ns + 1_000_000_000).xyz_mm, atol=0)


@pytest.mark.parametrize(
    ("part", "closed"),
    [(0.0, 1.0), (0.075, 0.5), (0.15, 0.0), (0.599, 0.0), (0.675, 0.5), (0.75, 1.0), (0.99, 1.0)],
)
def test_the_phases_follow_one_another_sixty_to_forty(part: float, closed: float) -> None:
    assert closure(EllipseOptions(), round(part * 1e9)) == pytest.approx(closed, abs=1e-3)
    assert closure(EllipseOptions(period_s=2.0), round(part * 2e9)) == pytest.approx(closed, abs=1e-3)


def test_the_wall_moves_at_most_two_millimetres_a_field_and_without_jerks() -> None:
    places = np.array([liner.targets(t * 5_000_000).xyz_mm for t in range(201)])
    step = np.linalg.norm(np.diff(places, axis=0), axis=2)
    assert 0.5 < step.max() * 4 < 2.0
    assert np.abs(np.diff(step, axis=0)).max() < 0.06


def test_without_deflection_it_does_not_move() -> None:
    still = EllipseLiner(EllipseOptions(deflection_mm=0.0))
    assert_allclose(still.targets(CLOSED_NS).xyz_mm, still.targets(OPEN_NS).xyz_mm, atol=1e-12)
