"""Sections of the wall, widths and volumes."""

from itertools import product

import numpy as np
import pytest

from grabberd.errors import AnalysisError
from grabberd_liner.analysis.surface.fitting import choose_smoothing, fit_surface
from grabberd_liner.analysis.surface.sections import Plane, sections, symmetry_plane, volume_mm3
from liner.analysis.collapsing import (
    AXIS_Z_MM,
    COLUMNS,
    PITCH_MM,
    ROWS,
    SIGMA_8_BIT_MM,
    as_points,
    grid,
    outer,
    points,
)
from liner.analysis.test_grid import of

RADIUS_MM = 13.75
ARC = 5 * PITCH_MM / 12.5
CROWN = (COLUMNS - 1) / 2
PLANE = Plane(np.array([0.0, 0.0, AXIS_Z_MM]), np.array([0.0, 0.0, 1.0]))
SEGMENT_MM2 = RADIUS_MM**2 / 2 * (ARC + np.sin(ARC))
"""Between the open liner's seen wall and the plane through its axis: a sector and two triangles."""


def section(surface, x_mm, plane=None):
    """The one section at a height that the wall reaches."""
    (found,), _ = sections(surface, [x_mm], plane)
    return found


@pytest.fixture(scope="module")
def open_liner():
    return fit_surface(grid(), as_points(grid().target, grid().nominal_mm, 0.001))


def true_distance(x_mm, closed):
    """From the plane through the axis to the exact outer face's crown."""
    row = x_mm / PITCH_MM + (ROWS - 1) / 2
    for _ in range(20):
        row -= (outer(np.array(row), CROWN, closed)[0] - x_mm) / PITCH_MM
    return outer(np.array(row), CROWN, closed)[2] - AXIS_Z_MM


def test_the_nominal_plane_of_symmetry_goes_through_the_axis():
    plane = symmetry_plane(grid())
    assert plane.point_mm[2] == pytest.approx(AXIS_Z_MM)
    np.testing.assert_allclose(plane.normal / np.linalg.norm(plane.normal), [0, 0, 1], atol=1e-9)


def test_an_object_that_is_no_tube_has_none():
    with pytest.raises(AnalysisError, match="no axis"):
        symmetry_plane(of(5, 5))


def test_the_open_liners_section_is_an_arc(open_liner):
    arc = section(open_liner, 3.0, PLANE)
    np.testing.assert_allclose(arc.outline_mm[:, 0], 3.0, atol=1e-9)
    np.testing.assert_allclose(
        np.hypot(arc.outline_mm[:, 1], arc.outline_mm[:, 2] - AXIS_Z_MM), RADIUS_MM, atol=2e-3
    )
    assert float(arc.length_mm.value) == pytest.approx(ARC * RADIUS_MM, abs=2e-3)
    assert float(arc.chord_mm.value) == pytest.approx(2 * RADIUS_MM * np.sin(ARC / 2), abs=2e-3)
    assert float(arc.distance_mm.value) == pytest.approx(RADIUS_MM, abs=2e-3)
    assert float(arc.area_mm2.value) == pytest.approx(SEGMENT_MM2, abs=0.05)
    assert arc.within.all()


def test_what_the_cameras_do_not_see_is_not_made_up(open_liner):
    arc = section(open_liner, 0.0)
    assert (arc.distance_mm, arc.area_mm2, arc.least_width_mm, arc.opposite_mm) == (None,) * 4


def test_the_volume_is_area_times_height(open_liner):
    volume = volume_mm3(open_liner, (-20.0, 25.0), PLANE)
    assert float(volume.value) == pytest.approx(45 * SEGMENT_MM2, rel=1e-4)


def test_there_is_no_section_beyond_the_targets(open_liner):
    found, (missed,) = sections(open_liner, [80.0])
    assert not found
    assert "x = 80 mm" in missed


@pytest.mark.parametrize("closed", [0.5, 1.0], ids=["half closed", "closed"])
def test_widths_of_8_bit_fields_are_good_to_a_twentieth_of_a_millimetre_and_to_their_sigma(closed):
    rng = np.random.default_rng(8)
    capture = [points(closed, SIGMA_8_BIT_MM, rng, 0.1) for _ in range(4)]
    smoothing = choose_smoothing(grid(), capture)
    heights = np.linspace(-50.0, 50.0, 6)
    error, sigma = [], []
    for field, x_mm in product(capture, heights):
        distance = section(fit_surface(grid(), field, smoothing), x_mm, PLANE).distance_mm
        error.append(2 * (float(distance.value) - true_distance(x_mm, closed)))
        sigma.append(2 * float(distance.sigma))
    assert np.sqrt(np.mean(np.square(error))) < 0.05
    assert 0.3 < np.mean(np.square(np.array(error) / sigma)) < 2.5


def test_sigma_of_a_volume_is_by_how_much_it_spreads():
    rng = np.random.default_rng(9)
    capture = [points(0.5, SIGMA_8_BIT_MM, rng) for _ in range(10)]
    smoothing = choose_smoothing(grid(), capture)
    volumes = [volume_mm3(fit_surface(grid(), one, smoothing), (-20.0, 20.0), PLANE) for one in capture]
    spread = np.std([float(volume.value) for volume in volumes])
    assert 0.4 < spread / np.mean([volume.sigma for volume in volumes]) < 1.3


def test_where_the_targets_go_round_the_tube_opposite_walls_are_measured():
    whole = of(6, 24, lambda r, c: (6 * r, 15 * np.sin(c * np.pi / 12), 15 * np.cos(c * np.pi / 12)))
    flat = whole.nominal_mm * [1.0, 1.1, 0.9]
    surface = fit_surface(whole, as_points(whole.target, flat, 0.002))
    oval = section(surface, 15.0)
    assert float(oval.least_width_mm.value) == pytest.approx(27.0, abs=0.05)
    assert float(oval.opposite_mm.value) == pytest.approx(27.0, abs=0.1)


def test_holes_under_the_outline_are_told():
    field = points(0.5, SIGMA_8_BIT_MM, np.random.default_rng(1))
    hole = np.isin(grid().row, (8, 9)) & np.isin(grid().column, (2, 3))
    told = section(fit_surface(grid(), field.select(~hole)), 0.0).within
    assert 0.2 < told.mean() < 0.8


def test_sections_taken_together_are_those_taken_one_by_one(open_liner):
    heights = [-20.0, 900.0, 5.0]
    together, missed = sections(open_liner, heights, PLANE)
    assert len(missed) == 1
    for one, x_mm in zip(together, (-20.0, 5.0), strict=True):
        alone = section(open_liner, x_mm, PLANE)
        for name in ("length_mm", "chord_mm", "distance_mm", "area_mm2"):
            assert np.allclose(getattr(one, name), getattr(alone, name), rtol=1e-9)
