"""Starts far from the rig: focal length, distances and angles wrong by half and by four fifths."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from core.calibration.networks import TRUE, frame, network, rough, tied
from grabberd.core.calibration.adjustment.adjustment import AdjustmentSettings, adjust
from grabberd.core.calibration.adjustment.network import Network, Unknowns
from grabberd.core.geometry import project
from grabberd.errors import MeasurementError

FEW = frame(7, 5)
"""35 targets."""


def least_sum_of_squares(given: Network, unknowns: Unknowns) -> float:
    """Smallest sum of squares as scipy finds it from the true views, from projections alone."""
    loose = given.target_sigma_mm > 0

    def misclosures(values: np.ndarray) -> np.ndarray:
        views = unknowns.with_values(TRUE, values[: len(unknowns)])
        places = given.target_mm.copy()
        places[loose] = values[len(unknowns) :]
        seen = [project(view, places[given.target[given.view == k]]) for k, view in enumerate(views)]
        images = (given.xy_px - np.concatenate(seen)) / given.sigma_px
        offsets = (given.target_mm - places)[loose] / given.target_sigma_mm[loose]
        return np.concatenate([images.ravel(), offsets])

    start = np.concatenate([unknowns.values(TRUE), given.target_mm[loose]])
    return 2 * least_squares(misclosures, start, x_scale="jac", ftol=1e-9, xtol=1e-9, gtol=1e-9).cost


# The first ones of each kind, and of the first two hundred those that take the most steps.
@pytest.mark.parametrize(
    ("sigma_mm", "share", "seeds"),
    [
        (0.0, 0.5, (0, 1, 65, 150)),
        (0.0, 0.8, (0, 1, 26, 53)),
        (0.05, 0.5, (0,)),
        (0.05, 0.8, (65,)),
    ],
)
def test_a_poor_start_leads_to_the_same_minimum_as_the_truth(sigma_mm, share, seeds):
    for seed in seeds:
        given = network(places=FEW, target_sigma_mm=sigma_mm, seed=seed, start=rough(share=share, seed=seed))
        adjusted = adjust(given, tied())
        assert adjusted.sum_of_squares == pytest.approx(least_sum_of_squares(given, tied()), rel=1e-5), seed


@pytest.mark.parametrize("share", [0.0, 0.5, 0.8])
def test_steps_that_go_to_and_fro_across_the_minimum_reach_it(share):
    given = network(places=FEW, target_sigma_mm=0.05, seed=34, start=rough(share=share, seed=34))
    assert adjust(given, tied()).sum_of_squares == pytest.approx(107.5538, abs=1e-3)  # as scipy finds it


def test_a_start_that_is_too_poor_is_named_as_the_cause():
    given = network(places=FEW, start=rough(share=0.8, seed=53))
    with pytest.raises(MeasurementError, match="not converged after") as refused:
        adjust(given, tied(), AdjustmentSettings(most_steps=1))
    assert "a start that is nearer" in refused.value.hint
    assert "rig" not in refused.value.hint
