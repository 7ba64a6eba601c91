from dataclasses import replace

import numpy as np
import pytest

from core.calibration.networks import TRUE, network, tied
from grabberd.core.calibration.adjustment.adjustment import adjust
from grabberd.core.calibration.residuals import with_unmodelled, without_blunders


def contradictory(rms_px=0.06, seed=1, target_sigma_mm=0.0):
    """Image points located to .001 to .016 px, that a model misses by far more."""
    rng = np.random.default_rng(seed)
    given = network(sigma_px=0.005, seed=seed, target_sigma_mm=target_sigma_mm)
    sigma = 10 ** rng.uniform(-3.0, -1.8, given.xy_px.shape)
    return replace(given, xy_px=given.xy_px + rng.normal(size=sigma.shape) * rms_px, sigma_px=sigma)


@pytest.mark.parametrize("target_sigma_mm", [0.0, 0.01])
def test_what_the_model_misses_is_found(target_sigma_mm):
    enlarged, added_px = with_unmodelled(contradictory(target_sigma_mm=target_sigma_mm), tied())
    assert added_px == pytest.approx(0.06, rel=0.1)
    assert adjust(enlarged, tied()).sigma0 == pytest.approx(1, abs=0.05)


def test_true_sigmas_stay():
    given = network(sigma_px=0.05)
    enlarged, added_px = with_unmodelled(given, tied())
    assert added_px < 0.02
    assert np.allclose(enlarged.sigma_px, 0.05, atol=0.004)


@pytest.mark.parametrize("seed", range(4))
def test_a_sigma0_above_one_by_chance_enlarges_nothing(seed):
    given = network(sigma_px=0.05, seed=seed)
    adjusted = adjust(given, tied())
    bold = replace(given, sigma_px=given.sigma_px * adjusted.sigma0 / 1.04)
    assert adjust(bold, tied()).sigma0 == pytest.approx(1.04, abs=0.001)
    assert with_unmodelled(bold, tied())[1] == 0.0


def test_sigmas_that_are_too_large_stay_too():
    given = network(sigma_px=0.05)
    enlarged, added_px = with_unmodelled(replace(given, sigma_px=4 * given.sigma_px), tied())
    assert added_px == 0
    assert np.array_equal(enlarged.sigma_px, 4 * given.sigma_px)


def test_image_points_that_are_only_too_sure_of_themselves_are_no_blunders():
    sure = contradictory()
    assert len(without_blunders(sure, tied(), most_share=1.0)[1]) > 3
    assert without_blunders(with_unmodelled(sure, tied())[0], tied())[1] == ()


def test_a_blunder_is_found_beside_what_the_model_misses():
    sure = contradictory()
    xy = sure.xy_px.copy()
    xy[17] += (1.5, -1.0)
    blunders = without_blunders(with_unmodelled(replace(sure, xy_px=xy), tied())[0], tied())[1]
    assert [(one.view, one.target) for one in blunders] == [("left", 17)]
    assert TRUE[0].name == "left"


@pytest.mark.parametrize("stated", [2.0, 5.0, 20.0])
def test_a_certificate_that_is_better_than_it_states_hides_nothing(stated):
    given = network(sigma_px=0.02, seed=3, target_sigma_mm=0.002)
    sure = replace(given, sigma_px=given.sigma_px / 4, target_sigma_mm=stated * given.target_sigma_mm)
    enlarged, added_px = with_unmodelled(sure, tied())
    assert np.hypot(0.005, added_px) == pytest.approx(0.02, rel=0.25)
    adjusted, blunders = without_blunders(enlarged, tied())
    assert blunders == ()
    assert adjusted.sigma0 < 1.05
    assert adjusted.sigma0_images == pytest.approx(1.0, abs=0.1)
