from dataclasses import replace

import numpy as np
import pytest

from core.reconstruction.repeated import grid, measured, series_of
from grabberd.core.reconstruction.smoothing import ErrorShares, rest_fields

SIGMA_MM = np.array([0.05, 0.04, 0.12])


def still(white, common, fields=80, targets=100):
    """A series at rest of variance SIGMA_MM²: `white` of it white, `common` of the rest common."""
    rng = np.random.default_rng(1)
    true = np.tile(grid(targets), (fields, 1, 1))
    return series_of(
        measured(true, rng, SIGMA_MM * white**0.5, SIGMA_MM * (1 - white) ** 0.5, common), SIGMA_MM
    )


@pytest.mark.parametrize("white", [0.3, 0.7, 1.0])
@pytest.mark.parametrize("common", [0.2, 0.6])
def test_white_and_opposite_parts_come_out_of_repeated_measurements(white, common):
    series = still(white, common)
    shares = ErrorShares.of(series, rest_fields(series), bits=1)
    assert shares.white == pytest.approx(np.full(3, white), rel=0.08)
    assert shares.opposite == pytest.approx(np.full(3, (1 - white) * (1 - common)), abs=0.1)


def test_at_one_bit_what_the_covariance_leaves_is_common():
    series = still(0.4, 0.6)
    shares = ErrorShares.of(series, rest_fields(series), bits=1)
    assert shares.common == pytest.approx(np.full(3, 0.36), abs=0.1)
    assert shares.white + shares.opposite + shares.common == pytest.approx(np.ones(3), abs=0.01)


def test_with_many_bits_next_to_nothing_is_common():
    series = still(0.4, 0.6)
    assert (ErrorShares.of(series, rest_fields(series), bits=8).common < 0.15).all()


def test_an_object_at_rest_rests_in_nearly_all_fields():
    assert rest_fields(still(0.8, 0.2)).mean() > 0.9


def test_fields_in_which_it_moves_are_told_from_those_in_which_it_rests():
    moves = np.zeros(90, bool)
    moves[30:50] = True
    true = np.tile(grid(40), (90, 1, 1))
    true[:, :, 2] += 0.3 * np.cumsum(moves)[:, np.newaxis]
    rest = rest_fields(series_of(measured(true, np.random.default_rng(2), SIGMA_MM, 0.0), SIGMA_MM))
    assert not rest[31:50].any()
    assert rest[2:27].mean() > 0.9
    assert rest[53:].mean() > 0.9


def test_where_too_little_rests_all_is_taken_for_white():
    series = still(0.4, 0.2, fields=6, targets=5)
    shares = ErrorShares.of(series, np.zeros(6, bool), bits=1)
    assert shares.white.tolist() == [1, 1, 1]
    assert not shares.opposite.any()
    assert not shares.common.any()


def test_progressive_pictures_have_no_part_that_goes_by_parity():
    rng = np.random.default_rng(1)
    true = np.tile(grid(100), (80, 1, 1))
    series = series_of(true + rng.normal(size=true.shape) * SIGMA_MM, SIGMA_MM)
    shares = ErrorShares.of(series, rest_fields(series, interlaced=False), bits=8, interlaced=False)
    assert not shares.opposite.any()
    assert shares.white == pytest.approx(np.ones(3), rel=0.05)


@pytest.mark.parametrize(("rate_hz", "interlaced"), [(25, False), (60, False), (60, True), (120, False)])
def test_a_slow_movement_is_no_rest_however_many_fields_it_takes(rate_hz, interlaced):
    fields = round(3.6 * rate_hz)
    time_s = np.arange(fields) / rate_hz
    true = np.tile(grid(60), (fields, 1, 1))
    true[:, :, 2] += np.interp(time_s, [1.2, 2.4], [0.0, 14.0])[:, np.newaxis]
    noisy = true + np.random.default_rng(4).normal(size=true.shape) * SIGMA_MM
    rest = rest_fields(series_of(noisy, SIGMA_MM, rate_hz=rate_hz), interlaced=interlaced)
    assert not rest[(time_s > 1.3) & (time_s < 2.3)].any()
    assert rest[(time_s > 0.1) & (time_s < 1.1)].mean() > 0.9


def test_lost_fields_are_not_compared_across():
    series = still(0.5, 0.2)
    apart = replace(series, n=3 * series.n, time_s=3 * series.time_s)
    assert not rest_fields(apart).any()
