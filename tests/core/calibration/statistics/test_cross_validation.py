from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.calibration.networks import THREE, frame, network, rough, tied
from grabberd.core.calibration.significance import cross_validate, spatial_blocks
from grabberd.errors import MeasurementError


def normalised(found):
    """Errors over their predicted σ."""
    return found.error_mm / np.sqrt(np.einsum("nkk->nk", found.covariance_mm2))


@given(count=st.integers(1, 20))
def test_blocks_are_of_one_size_within_a_factor_of_two_and_apart_in_space(count):
    places = frame()
    block = spatial_blocks(places, count)
    sizes = np.bincount(block)
    assert len(sizes) == count
    assert sizes.max() <= 2 * sizes.min() + 1


def test_two_blocks_are_the_halves_of_the_longest_side():
    places = frame()
    block = spatial_blocks(places, 2)
    assert places[block == 0, 0].max() < places[block == 1, 0].min()


def test_more_blocks_than_targets_are_refused():
    with pytest.raises(MeasurementError, match="3 targets cannot be divided into 4 blocks"):
        spatial_blocks(np.eye(3), 4)


def test_every_target_is_held_out_once():
    found = cross_validate(network(start=rough()), tied())
    assert sorted(found.target) == list(range(108))
    assert np.array_equal(found.block, spatial_blocks(frame(), 6)[found.target])
    assert not len(found.unchecked)
    assert found.freedom == 324
    assert found.rmse_mm[3] == pytest.approx(np.sqrt((found.rmse_mm[:3] ** 2).sum()))


@pytest.mark.slow
@pytest.mark.parametrize("sigma_mm", [0.0, 0.02])
def test_the_errors_are_as_great_as_predicted(sigma_mm):
    found = [cross_validate(network(target_sigma_mm=sigma_mm, seed=seed), tied()) for seed in range(15)]
    assert np.mean([one.chi2 / one.freedom for one in found]) == pytest.approx(1.0, abs=0.05)
    p = np.concatenate([one.block_p for one in found])
    assert np.mean(p) == pytest.approx(0.5, abs=0.1)
    assert np.mean(p < 0.1) == pytest.approx(0.1, abs=0.08)
    assert np.mean([one.p < 0.05 for one in found]) < 0.3
    together = np.concatenate([normalised(one) for one in found])
    assert np.std(together, axis=0) == pytest.approx(np.ones(3), abs=0.06)


def test_what_the_model_cannot_follow_shows():
    good = network()
    bent = good.xy_px + 0.3 * np.sin(good.xy_px[:, ::-1] / 15.0)
    found = cross_validate(replace(good, xy_px=bent), tied().without([f"left.b{i}" for i in range(1, 6)]))
    assert found.rmse_mm[3] > 2 * cross_validate(good, tied()).rmse_mm[3]


def test_a_wrong_place_in_the_frames_file_shows_where_it_is():
    wrong = network(target_sigma_mm=0.01)
    wrong.target_mm[40, 2] += 0.5
    found = cross_validate(wrong, tied())
    assert found.target[np.abs(normalised(found)).max(axis=1).argmax()] == 40
    assert found.p < 1e-3


def test_targets_that_cannot_be_checked_are_named():
    one = network()
    known = np.zeros((108, 3))
    known[9] = np.inf
    partly = replace(one.select(~((one.target == 3) & (one.view == 0))), target_sigma_mm=known)
    found = cross_validate(partly, tied())
    assert found.unchecked.tolist() == [3, 9]
    assert len(found.target) == 106


def test_three_views_are_validated_too():
    assert 0.5 < np.sqrt(cross_validate(network(THREE), tied(THREE)).chi2 / 324) < 1.5
