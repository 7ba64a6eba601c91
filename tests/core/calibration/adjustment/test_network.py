from dataclasses import replace

import numpy as np
import pytest

from core.calibration.networks import frame, network, rough
from grabberd.errors import MeasurementError

WHOLE = network(places=frame(3, 3))


def test_chosen_image_points_keep_targets_and_views():
    left = WHOLE.select(WHOLE.view == 0)
    assert len(left) == 9
    assert len(left.target_mm) == 9
    assert len(left.views) == 2


def test_other_values_to_start_from_change_nothing_else():
    other = WHOLE.starting_from(rough())
    assert other.views == rough()
    assert other.xy_px is WHOLE.xy_px


def test_targets_are_counted_by_the_views_that_see_them():
    partly = WHOLE.select((WHOLE.view == 0) | (WHOLE.target > 2))
    assert partly.sightings.tolist() == [1, 1, 1, 2, 2, 2, 2, 2, 2]


def test_a_target_is_undetermined_if_seen_less_often_than_its_unknown_coordinates_need():
    known = np.zeros((9, 3))
    known[1], known[2, 2], known[3] = np.inf, np.inf, np.inf
    partly = replace(WHOLE.select((WHOLE.view == 0) | (WHOLE.target > 2)), target_sigma_mm=known)
    assert np.flatnonzero(partly.undetermined).tolist() == [1]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"view": np.full(18, 2)}, "none of the 2 views"),
        ({"target": np.full(18, 9)}, "none of the 9 targets"),
        ({"target": np.zeros(18, np.intp)}, "two image points in one view"),
        ({"target": np.arange(17)}, "other numbers"),
        ({"sigma_px": np.zeros((18, 2))}, "out of range or not finite"),
        ({"xy_px": np.full((18, 2), np.nan)}, "out of range or not finite"),
        ({"target_sigma_mm": -np.ones((9, 3))}, "out of range or not finite"),
        ({"target_sigma_mm": np.ones((8, 3))}, "another number of σ"),
    ],
)
def test_contradictions_are_refused(change, reason):
    with pytest.raises(MeasurementError, match=reason):
        replace(WHOLE, **change)
