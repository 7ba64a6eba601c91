"""The truth of the simulated wall, against what is known otherwise."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq
from scipy.special import ellipe

from grabberd_fake import FakeOptions, truth_of_wall
from grabberd_fake.ellipse_truth import wall_sheet
from grabberd_fake.liner import EllipseLiner

OPEN_NS, MOVING_NS, CLOSED_NS = 400_000_000, 60_000_000, 900_000_000
LONG = {"scene": "ellipse", "ellipse": {"length_mm": 300.0, "rows": 3, "columns": 8}}
"""So long that its middle is a cylinder over an ellipse, but for the curvature along it."""


def closed(options=None):
    return truth_of_wall(options or {"scene": "ellipse"}, CLOSED_NS)


def test_the_open_liner_is_a_cylinder_under_its_pretension_alone() -> None:
    truth = truth_of_wall({"scene": "ellipse"}, OPEN_NS)
    assert_allclose(truth.strain, 0, atol=1e-12)
    assert_allclose(truth.stretch, 1, atol=1e-12)
    assert_allclose(truth.curvature_per_m, np.tile([[0, 0], [0, 80.0]], (108, 1, 1)), atol=1e-9)
    assert_allclose(truth.tension_n_per_m[:, 0, 0], 60 / (2 * np.pi * 0.0125), rtol=1e-9)
    assert_allclose(truth.tension_n_per_m[:, 1], 0, atol=1e-9)
    assert_allclose(truth.moment_n, 0, atol=1e-9)


def test_open_and_free_with_equal_vacuum_on_both_sides_nothing_touches_it() -> None:
    assert_allclose(truth_of_wall({"scene": "ellipse"}, OPEN_NS).pressure_kpa, 0, atol=1e-6)


def test_a_difference_of_pressure_is_carried_by_the_inner_face() -> None:
    truth = truth_of_wall({"scene": "ellipse", "ellipse": {"vacuum": {"liner_kpa": 52.0}}}, OPEN_NS)
    assert_allclose(truth.pressure_kpa, 10 * 12.5 / 11.25, atol=1e-6)


def test_closed_the_chamber_is_at_atmosphere() -> None:
    truth = closed()
    assert (truth.pulsation_kpa, truth.liner_kpa) == (0.0, 42.0)


def test_places_and_normals_are_those_of_the_targets_wall() -> None:
    for time_ns in (OPEN_NS, MOVING_NS, CLOSED_NS):
        truth, wall = (
            truth_of_wall({"scene": "ellipse"}, time_ns),
            EllipseLiner(FakeOptions().ellipse).wall(time_ns),
        )
        assert_allclose(truth.xyz_mm, wall.xyz_mm, atol=1e-6)
        assert_allclose(truth.normal, wall.normal, atol=1e-6)
        assert_allclose(
            truth.basis[:, 0], wall.along_x / np.linalg.norm(wall.along_x, axis=1)[:, None], atol=1e-6
        )


def test_strain_is_what_finite_differences_of_neighbouring_wall_show() -> None:
    """The stretch of short lines of the wall, drawn when it was open."""
    fine = {"scene": "ellipse", "ellipse": {"pitch_mm": 1.0, "rows": 3, "columns": 3, "length_mm": 130.0}}
    options = FakeOptions.read(fine)
    places = {t: truth_of_wall(options, t).xyz_mm.reshape(3, 3, 3) for t in (OPEN_NS, CLOSED_NS)}
    edges = {t: np.array([p[2, 1] - p[0, 1], p[1, 2] - p[1, 0]]) / 2 for t, p in places.items()}
    gram = {t: edge @ edge.T for t, edge in edges.items()}
    measured = (gram[CLOSED_NS] - gram[OPEN_NS]) / 2
    assert_allclose(truth_of_wall(options, CLOSED_NS).strain[4], measured, atol=2e-3)


def test_principal_stretches_are_those_of_the_strain_and_their_directions_perpendicular() -> None:
    truth = closed()
    assert_allclose(
        ((truth.stretch**2 - 1) / 2).sum(axis=1), np.trace(truth.strain, axis1=1, axis2=2), atol=1e-12
    )
    assert_allclose(np.linalg.norm(truth.direction, axis=2), 1, atol=1e-12)
    assert_allclose((truth.direction[:, 0] * truth.direction[:, 1]).sum(axis=1), 0, atol=1e-10)
    assert_allclose((truth.direction * truth.normal[:, None]).sum(axis=2), 0, atol=1e-9)


def test_strain_from_another_time_composes() -> None:
    """Between two times: (C - G)/2 of the one is the difference of both, in the basis of the first."""
    same = truth_of_wall({"scene": "ellipse"}, CLOSED_NS, reference_ns=CLOSED_NS)
    assert_allclose(same.strain, 0, atol=1e-12)
    assert_allclose(same.tension_n_per_m, closed().tension_n_per_m)
    back = truth_of_wall({"scene": "ellipse"}, OPEN_NS, reference_ns=CLOSED_NS)
    assert_allclose(back.stretch, 1 / closed().stretch[:, ::-1], atol=1e-9)


def test_under_a_long_liner_pressure_is_that_of_the_bent_and_tensioned_ellipse() -> None:
    """T κ - D κ'' round the section, by the ellipse's curvature and finite differences along the arc."""
    options = FakeOptions.read(LONG)
    truth = closed(options)
    middle = slice(8, 16)
    theta = np.linspace(-2.2, 2.2, 44001)
    p = 12.5 - 5.0
    q = 12.5 * _other_axis(p / 12.5)
    speed = np.hypot(q * np.cos(theta), p * np.sin(theta))
    arc = np.concatenate([[0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(theta))])
    arc -= np.interp(0, theta, arc)
    curvature = p * q / speed**3
    second = np.gradient(np.gradient(curvature, arc), arc)
    s = (np.arange(8) - 3.5) * 6.5
    around = np.interp(s, arc, curvature)
    assert_allclose(truth.curvature_per_m[middle, 1, 1], 1000 * around, atol=0.02)
    stiffness = 3 * 2.5**3 / 12 / 0.75
    bent = -1000 * stiffness * np.interp(s, arc, second)
    along = truth.tension_n_per_m[middle, 0, 0] * truth.curvature_per_m[middle, 0, 0] / 1000
    across = truth.tension_n_per_m[middle, 1, 1] * around
    assert_allclose(truth.wall_kpa[middle], bent + along + across, atol=0.04 * np.abs(bent).max())
    assert_allclose(
        truth.pressure_kpa[middle],
        (42.0 + truth.wall_kpa[middle]) / (1 - 1.25 * (around + truth.curvature_per_m[middle, 0, 0] / 1000)),
        rtol=0.01,
    )


def _other_axis(p):
    return brentq(lambda q: 4 * q * ellipe(1 - (p / q) ** 2) - 2 * np.pi, 1, 2)


@pytest.mark.parametrize("deflection_mm", [1.0, 5.0, 6.0])
def test_a_finer_grid_says_the_same(deflection_mm: float) -> None:
    liner = FakeOptions.read({"scene": "ellipse", "ellipse": {"deflection_mm": deflection_mm}}).ellipse
    bendings = []
    for grid in ((64, 256), (128, 512)):
        _, sheet = wall_sheet(liner, 1.0, grid)
        values = sheet.double_divergence(sheet.raised * sheet.bending[1, 1])
        bendings.append(sheet.at(values, np.array([0.0, 9.75, 55.25]), np.array([0.0, 16.25])))
    assert_allclose(bendings[0], bendings[1], atol=1e-5 * max(1.0, np.abs(bendings[1]).max()))


def test_the_tube_mirrors_itself() -> None:
    pressure = closed().pressure_kpa.reshape(18, 6)
    assert_allclose(pressure, pressure[::-1], atol=1e-6)
    assert_allclose(pressure, pressure[:, ::-1], atol=1e-6)


def test_only_the_ellipse_has_this_truth() -> None:
    with pytest.raises(ValueError, match="'blank' is not the prescribed wall"):
        truth_of_wall({"scene": "blank"}, 0)


def test_thick_targets_stand_off_the_wall() -> None:
    thick = EllipseLiner(
        FakeOptions.read({"scene": "ellipse", "ellipse": {"target_thickness_mm": 0.2}}).ellipse
    )
    plain = EllipseLiner(FakeOptions().ellipse)
    off = thick.targets(CLOSED_NS).xyz_mm - plain.targets(CLOSED_NS).xyz_mm
    assert_allclose(off, 0.2 * plain.targets(CLOSED_NS).normal, atol=1e-9)
