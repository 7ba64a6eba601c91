"""What is measured of an outline, and that its derivatives are its own."""

import numpy as np
import pytest

from grabberd_liner.analysis.surface.sections import (
    Plane,
    area_to,
    chord,
    distance_to,
    least_width,
    length,
    opposite,
)

PLANE = Plane(np.array([0.0, 0.5, -3.0]), np.array([0.0, 0.2, 2.0]))
TURN = np.linspace(0.1, 2.9, 41)
ROUND = np.linspace(0.0, 2 * np.pi, 41)
MEASURES = {
    "length": length,
    "chord": chord,
    "distance": lambda outline: distance_to(PLANE, outline),
    "area": lambda outline: area_to(PLANE, outline),
    "least width": least_width,
    "opposite": opposite,
}


def arc(turn=TURN, radius=10.0):
    """Uneven, so that no place is in another's way."""
    wave = radius + np.sin(3 * turn)
    return np.stack([np.full_like(turn, 7.0), -wave * np.cos(turn), wave * np.sin(turn)], axis=1)


@pytest.mark.parametrize("name", MEASURES)
def test_derivatives_are_those_by_the_places_across_the_height(name):
    outline = arc(ROUND) * [1.0, 1.0, 0.8] if name in ("least width", "opposite") else arc()
    measure, step = MEASURES[name], 1e-5
    slopes = measure(outline).slopes
    for place, axis in np.ndindex(len(outline), 2):
        moved = np.zeros_like(outline)
        moved[place, axis + 1] = step
        found = (measure(outline + moved).value - measure(outline - moved).value) / (2 * step)
        assert slopes[place, axis + 1] == pytest.approx(found, abs=1e-6)
    assert not slopes[:, 0].any()


def test_lengths_and_areas_are_those_of_the_curve_and_not_of_the_polygon():
    half = arc(np.linspace(0, np.pi, 41)) / 1.0
    circle = np.stack(
        [half[:, 0], -10 * np.cos(np.linspace(0, np.pi, 41)), 10 * np.sin(np.linspace(0, np.pi, 41))]
    )
    level = Plane(np.zeros(3), np.array([0.0, 0.0, 1.0]))
    assert length(circle.T).value == pytest.approx(10 * np.pi, rel=1e-5)
    assert area_to(level, circle.T).value == pytest.approx(50 * np.pi, rel=1e-2)


def test_beside_the_plane_s_point_there_is_no_distance():
    aside = Plane(np.array([0.0, 50.0, 0.0]), np.array([0.0, 0.0, 1.0]))
    assert np.isnan(distance_to(aside, arc()).value)
