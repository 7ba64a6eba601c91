"""The wall's movement as one number a field."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from grabberd.core.reconstruction import Points
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.pulsation.movement import Movement, TimedPoints, first_movement
from liner.analysis.pulsating import capture, times


def test_it_is_how_far_the_liveliest_target_goes_open_high() -> None:
    (movement,) = first_movement([capture(times(50, 0.0), sigma_mm=1e-6)])
    assert np.ptp(movement.value_mm) == pytest.approx(4.68, abs=0.05)
    assert movement.value_mm[20] > 1 > -1 > movement.value_mm[45]


def test_its_sigma_is_what_noise_does_to_it() -> None:
    exact = first_movement([capture(times(100), sigma_mm=1e-6)])[0]
    noisy = first_movement([capture(times(100), sigma_mm=0.05)])[0]
    scale = np.polyfit(exact.value_mm, noisy.value_mm, 1)
    left = (noisy.value_mm - np.polyval(scale, exact.value_mm)) / noisy.sigma_mm
    assert scale == pytest.approx([1.0, 0.0], abs=0.02)
    assert np.sqrt((left**2).mean()) == pytest.approx(1.0, abs=0.25)
    assert 0.005 < noisy.sigma_mm[0] < 0.05


def test_missing_targets_change_it_by_no_more_than_their_noise() -> None:
    whole = first_movement([capture(times(100))])[0]
    holes = first_movement([capture(times(100), missing=0.3, seed=1)])[0]
    assert np.abs(whole.value_mm - holes.value_mm).max() < 0.1
    assert holes.sigma_mm.mean() > whole.sigma_mm.mean()


def test_targets_that_hide_in_the_closed_liner_do_not_shift_it() -> None:
    opened, closed = (one.points for one in capture([0.2, 0.8], sigma_mm=0.0))
    part = np.interp(times(100) % 1.0, [0.0, 0.1, 0.5, 0.6], [0.0, 1.0, 1.0, 0.0])
    fields = []
    for time_s, share in zip(times(100), part, strict=True):
        places_mm = share * opened.xyz_mm + (1 - share) * closed.xyz_mm
        points = replace(opened, xyz_mm=places_mm)
        fields.append(TimedPoints(time_s, points if share > 0.3 else points.select(points.target % 3 > 0)))
    (movement,) = first_movement([fields])
    scale = np.polyfit(part, movement.value_mm, 1)
    assert_allclose(movement.value_mm, np.polyval(scale, part), atol=1e-6)


def test_several_captures_move_in_one_direction() -> None:
    first, second = first_movement([capture(times(40, 0.0), 1e-6), capture(times(40, 0.7), 1e-6)])
    assert_allclose(first.value_mm[-1], np.interp(0.78, second.time_s, second.value_mm), atol=1e-3)


def test_fields_without_points_do_not_count() -> None:
    fields = capture(times(60))
    fields[7] = fields[7]._replace(points=Points.none())
    (movement,) = first_movement([fields])
    assert len(movement.time_s) == 59
    assert fields[7].time_s not in movement.time_s


def test_too_few_fields_are_refused() -> None:
    with pytest.raises(AnalysisError, match="too few for a movement") as caught:
        first_movement([capture(times(5))])
    assert "measure the capture" in caught.value.hint


def test_its_speed_is_that_of_the_faster_step_beside_a_field() -> None:
    time_s = np.arange(5) * 0.02
    movement = Movement(time_s, np.array([0.0, 0.0, 4.0, 5.0, 5.0]), np.full(5, 0.01))
    assert_allclose(movement.speed_mm_per_s(time_s), [0.0, 200.0, 200.0, 50.0, 0.0])
