"""Stroke, rate, phases and lags as quantities of the field."""

import numpy as np
import pytest

from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.pulsation.phases import (
    lag_quantities,
    laser_quantities,
    movement_quantities,
    vacuum_quantities,
    wall_quantities,
)
from liner.analysis.pulsation.test_pulsator_limits import phases


def by_name(found):
    return {one.quantity.name: one for one in found}


def test_the_liner_opens_and_closes_in_wall_phases_a_and_c():
    found = by_name(wall_quantities(phases([0.05, 0.5, 0.03, 0.42], defined_by="wall"), ""))
    assert [found[f"liner_{word}_s"].value for word in ("opening", "open", "closing")] == [0.05, 0.5, 0.03]
    assert {found[f"liner_{word}_s"].sigma for word in ("opening", "open", "closing")} == {0.001}
    assert found["wall_ratio"].value == pytest.approx(0.55)


def test_the_vacuum_has_phases_and_the_pulsator_s_ratio():
    found = by_name(vacuum_quantities(phases([0.15, 0.45, 0.12, 0.28]), ""))
    assert {name: one.value for name, one in found.items()} == pytest.approx(
        {"phase_a_s": 0.15, "phase_b_s": 0.45, "phase_c_s": 0.12, "pulsator_ratio": 0.6}
    )


@pytest.mark.parametrize(
    "quantities", [wall_quantities, laser_quantities, vacuum_quantities, movement_quantities]
)
def test_what_is_not_known_says_why(quantities):
    found = quantities(None, "the wall flutters")
    assert {one.reason for one in found} == {"the wall flutters"}
    assert np.isnan([part for one in found for part in (one.value, one.sigma, one.common)]).all()


def test_a_lag_shares_the_clocks_sigma_with_other_captures():
    lags = [Estimate(np.asarray(one), np.asarray(0.003)) for one in (0.02, 0.05)]
    for one, value in zip(lag_quantities(lags, 0.004, ""), (0.02, 0.05), strict=True):
        assert (one.value, one.sigma, one.common) == pytest.approx((value, 0.005, 0.004))
    assert {one.reason for one in lag_quantities((), 0.0, "no clock")} == {"no clock"}
