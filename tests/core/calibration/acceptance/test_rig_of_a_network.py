"""The rig in a workshop's terms, a length that took no part, and neighbouring residuals."""

from dataclasses import replace

import numpy as np
import pytest

from core.calibration.networks import TRUE, frame, network, rough, tied
from core.calibration.sights import NOMINAL
from grabberd.core.calibration.adjustment.adjustment import Adjustment, adjust
from grabberd.core.calibration.residuals import residual_patterns
from grabberd.core.calibration.rig_quantities import compared_rig
from grabberd.core.calibration.significance import CheckLength, measured_length

LENGTH = CheckLength(1, 108, float(np.linalg.norm(frame()[-1] - frame()[0])), 0.02)


@pytest.fixture(scope="module")
def adjusted() -> Adjustment:
    return adjust(network(start=rough()), tied())


def rows(adjusted, **changes):
    found = compared_rig(
        adjusted.views, adjusted.parameter_covariance, NOMINAL, frame().mean(axis=0), **changes
    )
    return {(one.name, one.view): one for one in found}


def test_sigma_of_base_and_distance_holds_over_many_networks():
    """Against the truth, in their own σ."""
    off = []
    true = compared_rig(TRUE, np.zeros((36, 36)), NOMINAL, frame().mean(axis=0))
    for seed in range(12):
        one = adjust(network(seed=seed), tied())
        found = rows(one)
        off += [
            (found[row.name, row.view].found - row.found) / found[row.name, row.view].sigma
            for row in true
            if row.name != "handedness"
        ]
    assert 0.5 < np.mean(np.square(off)) < 1.8


def test_what_differs_from_nominal_by_a_quarter_is_five_sigma_away(adjusted):
    nominal = replace(NOMINAL, focal_length_mm=rows(adjusted)["focal_length", "left"].found * 1.25)
    found = compared_rig(adjusted.views, adjusted.parameter_covariance, nominal, frame().mean(axis=0))
    assert found[0].nominal_z == pytest.approx(-0.25 / 1.25 / 0.05, abs=0.1)


def test_a_previous_calibration_of_the_same_rig_is_no_difference(adjusted):
    again = rows(adjusted, previous=(adjusted.views, adjusted.parameter_covariance))
    assert all(one.previous_z == 0 for one in again.values() if one.name != "handedness")
    assert again["handedness", "left"].previous == again["handedness", "left"].found


def test_a_right_check_length_is_met_within_its_sigma(adjusted):
    found = measured_length(adjusted, LENGTH, 0, 107)
    assert abs(found.difference_mm) < 3 * found.sigma_mm
    assert 0.02 < found.sigma_mm < 0.1


def test_a_length_that_is_two_per_cent_shorter_is_missed_by_two_per_cent(adjusted):
    found = measured_length(adjusted, replace(LENGTH, length_mm=LENGTH.length_mm / 1.02), 107, 0)
    assert found.scale_percent == pytest.approx(2.0, abs=0.1)


def test_a_length_whose_target_a_view_has_lost_is_not_measured(adjusted):
    kept = adjusted.network.select((adjusted.network.target != 0) | (adjusted.network.view == 0))
    assert measured_length(adjust(kept, tied()), LENGTH, 0, 107) is None


def test_noise_has_no_pattern_and_a_bent_mirror_has(adjusted):
    assert all(abs(one.statistic) < 4 for one in residual_patterns(adjusted))
    bent = adjusted.residual_px + 0.1 * np.sin(adjusted.network.xy_px[:, 1:] / 60)
    assert all(one.statistic > 6 for one in residual_patterns(replace(adjusted, residual_px=bent)))
