"""The closed liner: the mean over its phases, and where it presses a teat."""

import numpy as np
import pytest

from grabberd.errors import AnalysisError
from grabberd_liner.analysis.load.load_profile import (
    Noise,
    is_empty,
    mean_profile,
    phase_weights,
    teat_heights,
)
from liner.analysis.load.profiles import SIGMA_N_PER_MM, TEAT_END_MM, X_MM, closed


def test_phases_stand_for_the_cycle_up_to_halfway_to_their_neighbours():
    phase = np.array([0.0, 0.1, 0.5, 0.9])
    assert phase_weights(phase, 0.0, 1.0) == pytest.approx([0.1, 0.25, 0.4, 0.25])
    assert phase_weights(phase, 0.4, 0.9) == pytest.approx([0.0, 0.0, 0.4, 0.0])


def test_a_mean_over_phases_weighs_each_by_the_part_of_the_cycle_that_it_stands_for():
    mean = mean_profile([closed(1.0), closed(2.0)], np.array([0.3, 0.1]), np.eye(2))
    assert mean.load_n_per_mm.value == pytest.approx(1.25 * closed().load_n_per_mm.value)


def test_the_sigma_of_a_mean_over_phases_holds_for_errors_that_all_phases_share():
    mean = mean_profile([closed()] * 5, np.ones(5), np.eye(5))
    assert mean.load_n_per_mm.covariance == pytest.approx(closed().load_n_per_mm.covariance)


def test_the_sigma_of_a_mean_over_phases_is_too_small_for_no_correlation():
    """Of two errors with σ 1 and 3, the mean has σ 2 at most, whatever their correlation."""
    one, other = closed().load_n_per_mm, closed().load_n_per_mm
    loads = [one, other._replace(covariance=9 * other.covariance)]
    profiles = [closed()._replace(load_n_per_mm=load) for load in loads]
    found = mean_profile(profiles, np.ones(2), np.eye(2)).load_n_per_mm.estimate.sigma
    assert (found >= 2 * SIGMA_N_PER_MM).all()


@pytest.mark.parametrize(("correlation", "left"), [(np.eye(4), 0.25), (np.ones((4, 4)), 1.0)])
def test_noise_averages_out_over_phases_as_far_as_it_is_not_the_same(correlation, left):
    noise = Noise(np.eye(3 * len(X_MM)), 0.5 * np.eye(3 * len(X_MM)))
    mean = mean_profile([closed()._replace(noise=noise)] * 4, np.ones(4), correlation).noise
    assert mean.own == pytest.approx(left * noise.own)
    assert mean.reference == pytest.approx(noise.reference)  # one reference state for all of them


def test_a_mean_of_states_whose_noise_was_not_asked_for_has_none():
    assert mean_profile([closed()] * 2, np.ones(2), np.eye(2)).noise is None


def test_the_teat_is_where_the_wall_is_pressed_and_held_apart():
    found = teat_heights(closed())
    assert np.array_equal(found.teat, X_MM <= TEAT_END_MM)


@pytest.mark.parametrize("upside_down", [False, True])
def test_the_teat_s_end_is_on_the_side_where_opposite_walls_meet(upside_down):
    found = teat_heights(closed(upside_down=upside_down))
    # The gap is 11.6 mm at the last height with a teat, .1 at the next, 5 mm away; walls meet at 1 mm + 3 σ.
    end_mm = TEAT_END_MM + 5.0 * (11.6 - 1.3) / (11.6 - 0.1)
    assert found.end_mm.value == pytest.approx(-end_mm if upside_down else end_mm)
    assert 1.0 < found.end_mm.sigma < 3.0
    assert found.end_mm.value == (found.first_mm if upside_down else found.last_mm)


def test_the_teat_s_end_does_not_jump_when_noise_decides_about_a_height():
    """At the height after the last, walls are as far apart as counts as surely so, a little more or less."""
    profile, after = closed(), int(np.flatnonzero(X_MM > TEAT_END_MM)[0])
    ends_mm = []
    for more_mm in (-1e-3, 1e-3):
        gap_mm = profile.gap_mm.value.copy()
        gap_mm[after] = 1.3 + more_mm
        found = teat_heights(profile._replace(gap_mm=profile.gap_mm._replace(value=gap_mm)))
        assert found.teat[after] == (more_mm > 0)
        ends_mm.append(found.end_mm.value)
    assert ends_mm[0] == pytest.approx(ends_mm[1], abs=0.01)


def falling(sigma_kpa=1.0, upside_down=False):
    """What presses the teat falls off from 40 kPa at 5 mm to nothing at 15, and the walls meet at 20."""
    kpa = np.interp(X_MM, [-55, 5, 10, 15, 20, 25], [4, 40, 24, 8, 0.5, 30])
    gap_mm = np.interp(X_MM, [-55, 5, 15, 20], [20, 10, 2, 0.2])
    profile = closed()
    if upside_down:
        kpa, gap_mm = kpa[::-1], gap_mm[::-1]
    return profile._replace(
        compression_kpa=profile.compression_kpa._replace(
            value=kpa, covariance=sigma_kpa**2 * profile.compression_kpa.covariance
        ),
        load_n_per_mm=profile.load_n_per_mm._replace(
            value=kpa / 40, covariance=sigma_kpa**2 * profile.load_n_per_mm.covariance
        ),
        gap_mm=profile.gap_mm._replace(value=gap_mm),
    )


@pytest.mark.parametrize("sigma_kpa", [0.5, 1.0, 5.0])
@pytest.mark.parametrize("upside_down", [False, True])
def test_the_teat_is_the_same_however_well_its_pressure_is_known(sigma_kpa, upside_down):
    """It ends where the compression has fallen to half its greatest, and begins with the first target."""
    found = teat_heights(falling(sigma_kpa, upside_down))
    heights_mm = -X_MM if upside_down else X_MM
    assert found.end_mm.value == pytest.approx(-11.25 if upside_down else 11.25)
    assert np.array_equal(found.teat, heights_mm <= 10)
    assert sorted((abs(found.first_mm), abs(found.last_mm))) == pytest.approx([11.25, 55])


def test_the_sigma_of_the_teat_s_end_grows_with_that_of_the_pressure():
    well, badly = (float(teat_heights(falling(sigma)).end_mm.sigma) for sigma in (0.5, 5.0))
    # It falls by 3.2 kPa/mm; noise of two neighbouring heights goes together in part.
    assert 0.5 < well < 1.0
    assert 1.2 < badly < 2.0


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
