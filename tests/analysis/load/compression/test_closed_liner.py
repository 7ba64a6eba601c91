"""The closed liner: the mean over its phases, and where it presses a teat."""

import numpy as np
import pytest

from analysis.load.profiles import SIGMA_N_PER_MM, TEAT_END_MM, X_MM, closed
from grabberd.analysis.load.compression.closed_liner import (
    is_empty,
    mean_profile,
    phase_weights,
    teat_heights,
)
from grabberd.errors import AnalysisError


def test_phases_stand_for_the_cycle_up_to_halfway_to_their_neighbours():
    phase = np.array([0.0, 0.1, 0.5, 0.9])
    assert phase_weights(phase, 0.0, 1.0) == pytest.approx([0.1, 0.25, 0.4, 0.25])
    assert phase_weights(phase, 0.4, 0.9) == pytest.approx([0.0, 0.0, 0.4, 0.0])


def test_a_mean_over_phases_weighs_each_by_the_part_of_the_cycle_that_it_stands_for():
    mean = mean_profile([closed(1.0), closed(2.0)], np.array([0.3, 0.1]))
    assert mean.load_n_per_mm.value == pytest.approx(1.25 * closed().load_n_per_mm.value)


def test_the_sigma_of_a_mean_over_phases_holds_for_errors_that_all_phases_share():
    mean = mean_profile([closed()] * 5, np.ones(5))
    assert mean.load_n_per_mm.covariance == pytest.approx(closed().load_n_per_mm.covariance)


def test_the_sigma_of_a_mean_over_phases_is_too_small_for_no_correlation():
    """Of two errors with σ 1 and 3, the mean has σ 2 at most, whatever their correlation."""
    one, other = closed().load_n_per_mm, closed().load_n_per_mm
    loads = [one, other._replace(covariance=9 * other.covariance)]
    profiles = [closed()._replace(load_n_per_mm=load) for load in loads]
    found = mean_profile(profiles, np.ones(2)).load_n_per_mm.estimate.sigma
    assert (found >= 2 * SIGMA_N_PER_MM).all()


def test_the_teat_is_where_the_wall_is_pressed_and_held_apart():
    found = teat_heights(closed())
    assert np.array_equal(found.teat, X_MM <= TEAT_END_MM)


@pytest.mark.parametrize("upside_down", [False, True])
def test_the_teat_s_end_is_on_the_side_where_opposite_walls_meet(upside_down):
    found = teat_heights(closed(upside_down=upside_down))
    true_mm = -TEAT_END_MM if upside_down else TEAT_END_MM
    assert abs(found.end_mm.value - true_mm) < 2 * found.end_mm.sigma
    assert 1.0 < found.end_mm.sigma < 3.0


def test_an_empty_liner_has_no_teat():
    with pytest.raises(AnalysisError, match="walls that are pressed meet each other"):
        teat_heights(closed(empty=True))


def test_a_liner_that_presses_itself_alone_is_empty():
    assert is_empty(closed(empty=True))


@pytest.mark.parametrize("shape", [{}, {"below": False}, {"pressed": False}, {"scale": 0.05}])
def test_a_liner_that_presses_a_teat_or_nothing_is_not_called_empty(shape):
    assert not is_empty(closed(**shape))


def test_an_open_liner_presses_nothing():
    with pytest.raises(AnalysisError, match="no height is pressed"):
        teat_heights(closed(pressed=False))


def test_a_teat_that_reaches_as_far_as_is_seen_has_no_known_end():
    found = teat_heights(closed(below=False))
    assert np.array_equal(found.teat, X_MM <= TEAT_END_MM)
    assert found.end_mm is None
    assert found.reason.startswith("the teat's end is not among the heights that are seen")
