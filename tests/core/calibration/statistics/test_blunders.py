from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t as student

from core.calibration.networks import TRUE, deviation, frame, network, rough, tied
from grabberd.core.calibration.adjustment.adjustment import adjust
from grabberd.core.calibration.adjustment.network import Unknowns
from grabberd.core.calibration.residuals import critical_tau, without_blunders
from grabberd.errors import MeasurementError


def spoiled(given, points, shift_px=(1.0, -0.8)):
    xy = given.xy_px.copy()
    xy[list(points)] += shift_px
    return replace(given, xy_px=xy)


def test_a_few_gross_errors_are_found_and_nothing_else():
    bad = (5, 60, 130, 200)
    adjusted, found = without_blunders(spoiled(network(start=rough()), bad), tied())
    assert {(one.view, one.target) for one in found} == {
        ("left", 5), ("left", 60), ("right", 130 - 108), ("right", 200 - 108),
    }  # fmt: skip
    assert len(adjusted.network) == 216 - 4
    assert adjusted.sigma0 == pytest.approx(1.0, abs=0.15)
    assert np.abs(deviation(adjusted) / adjusted.sigma).max() < 5


def test_the_greatest_goes_first_with_its_evidence():
    given = spoiled(spoiled(network(), (5,), (3.0, 0.0)), (60,), (0.0, 1.0))
    _, (first, second) = without_blunders(given, tied())
    assert (first.target, second.target) == (5, 60)
    assert first.tau > first.critical
    assert first.residual_px[0] == pytest.approx(3.0 * first.redundancy[0], abs=0.5)
    assert first.xy_px == tuple(given.xy_px[5])


def test_good_pictures_lose_a_point_as_rarely_as_alpha_says():
    lost = sum(bool(without_blunders(network(seed=seed), tied())[1]) for seed in range(60))
    assert lost <= 4


def test_without_blunders_it_is_the_adjustment_itself():
    adjusted, found = without_blunders(network(), tied())
    assert found == ()
    alone = adjust(network(), tied())
    assert np.abs((adjusted.values - alone.values) / alone.sigma).max() < 1e-3


def test_the_critical_value_is_below_the_greatest_possible_and_nearly_normal_for_many():
    assert critical_tau(100, 5, 0.01) < np.sqrt(5)
    assert critical_tau(1, 100_000, 0.05) == pytest.approx(1.96, abs=0.001)
    assert critical_tau(432, 398, 0.01) == pytest.approx(4.17, abs=0.1)
    value = student.isf(0.0005, 19)
    assert critical_tau(1, 20, 0.001) == pytest.approx(value * np.sqrt(20 / (19 + value**2)))


def test_the_statistic_is_distributed_as_tau():
    known, small = Unknowns.of(TRUE, ("f_mm", "kappa_rad", "Z0_mm")), frame(3, 2)
    values = np.concatenate(
        [adjust(network(places=small, seed=seed), known).standardised.ravel() for seed in range(150)]
    )
    freedom = 4 * len(small) - 6
    for share in (0.5, 0.1, 0.01):
        assert np.mean(np.abs(values) > critical_tau(1, freedom, share)) == pytest.approx(share, rel=0.3)


def test_blunders_that_hide_one_another_are_found_all_the_same():
    rng = np.random.default_rng(0)
    bad = rng.choice(216, 20, replace=False)
    given = spoiled(network(), bad, (4.0, 4.0))
    adjusted, found = without_blunders(given, tied())
    assert {108 * (one.view == "right") + one.target for one in found} == set(bad)
    assert adjusted.sigma0 == pytest.approx(1.0, abs=0.15)


def test_too_many_are_refused():
    rng = np.random.default_rng(0)
    given = spoiled(network(), rng.choice(216, 40, replace=False), rng.uniform(-10, 10, (40, 2)))
    with pytest.raises(MeasurementError, match="more than 22 image points contradict") as refused:
        without_blunders(given, tied())
    assert "which target is which" in refused.value.hint


def test_a_refusal_names_targets_by_their_ids():
    rng = np.random.default_rng(0)
    given = spoiled(network(), rng.choice(216, 40, replace=False), rng.uniform(-10, 10, (40, 2)))
    with pytest.raises(MeasurementError, match=r"starting with target \d{4} in view"):
        without_blunders(replace(given, ids=np.arange(1001, 1109, dtype=np.int32)), tied())


def test_a_target_of_unknown_place_goes_with_its_last_picture():
    places = frame()
    known = np.zeros(places.shape)
    known[5] = np.inf
    adjusted, found = without_blunders(spoiled(network(target_sigma_mm=known), (5,), (0.0, 6.0)), tied())
    assert {one.target for one in found} == {5}
    assert adjusted.network.sightings[5] == 0
    assert np.isinf(adjusted.place_covariance_mm2[5, 0, 0])
