from dataclasses import replace

import numpy as np
import pytest

from core.reconstruction.repeated import series_of
from grabberd.core.reconstruction.accuracy import (
    PAPER_PRECISION,
    PAPER_RMSE,
    Coordinates,
    Truth,
    accuracy,
    true_places,
)
from grabberd.errors import MeasurementError

TARGETS = np.arange(1, 13, dtype=np.int32)
PLACES_MM = np.random.default_rng(1).uniform(-30, 30, (12, 3))
STILL = Truth(None, TARGETS, PLACES_MM, np.ones(12, bool))
SIGMA_MM = np.array([0.05, 0.10, 0.08])


def repeated(fields, error_mm):
    """Every target in every field; errors are broadcast to (fields, targets, 3)."""
    numbers = np.arange(fields, dtype=np.int64)
    return Coordinates(
        numbers,
        np.repeat(numbers, len(TARGETS)),
        np.tile(TARGETS, fields),
        (PLACES_MM + np.broadcast_to(error_mm, (fields, 12, 3))).reshape(-1, 3),
    )


def without(measured, gone):
    return Coordinates(measured.fields, measured.n[~gone], measured.target[~gone], measured.xyz_mm[~gone])


@pytest.fixture
def noisy():
    return repeated(200, np.random.default_rng(2).normal(0, SIGMA_MM, (200, 12, 3)))


def test_the_rmse_of_pure_noise_is_its_standard_deviation(noisy):
    report = accuracy(noisy, STILL)
    assert report.rmse[:3] == pytest.approx(SIGMA_MM, rel=0.05)
    assert (report.fields, report.matched, report.missing, report.wrong) == (200, 2400, 0, 0)


def test_xyz_is_the_root_of_the_sum_of_squares(noisy):
    for axes in (accuracy(noisy, STILL).rmse, accuracy(noisy, STILL).precision):
        assert axes.xyz_mm**2 == pytest.approx(axes.x_mm**2 + axes.y_mm**2 + axes.z_mm**2)


def test_a_constant_error_is_inaccurate_but_precise():
    report = accuracy(repeated(5, np.array([0.3, 0.0, -0.4])), STILL)
    assert report.rmse == pytest.approx((0.3, 0.0, 0.4, 0.5))
    assert report.precision == pytest.approx((0, 0, 0, 0), abs=1e-9)


def test_precision_does_not_see_what_each_target_has_for_itself(noisy):
    own_bias = np.random.default_rng(3).normal(0, 0.3, (1, 12, 3))
    biased = repeated(200, own_bias + (noisy.xyz_mm.reshape(200, 12, 3) - PLACES_MM))
    assert accuracy(biased, STILL).precision == pytest.approx(accuracy(noisy, STILL).precision)
    assert accuracy(biased, STILL).rmse.xyz_mm > 0.4


def test_a_moving_object_has_no_precision(noisy):
    moving = STILL.in_fields(noisy.fields)
    moving.xyz_mm[moving.n == 199] += 0.5
    assert accuracy(noisy, moving).precision is None


def test_one_field_alone_has_no_precision():
    assert accuracy(repeated(1, np.zeros(3)), STILL).precision is None


def test_truth_is_taken_from_the_points_own_field():
    shift = np.array([0.0, 1.0, 0.0])
    measured = repeated(3, np.arange(3)[:, None, None] * shift)
    moving = Truth(measured.n, measured.target, measured.xyz_mm, np.ones(36, bool))
    backwards = np.arange(36)[::-1]
    shuffled = Truth(
        moving.n[backwards], moving.target[backwards], moving.xyz_mm[backwards], moving.expected[backwards]
    )
    assert accuracy(measured, shuffled).rmse.xyz_mm == 0.0


def test_a_target_that_should_have_been_found_is_missing_in_every_field_without_it(noisy):
    gone = (noisy.target == 4) & (noisy.n < 7)
    assert accuracy(without(noisy, gone), STILL).missing == 7


def test_a_field_without_any_point_misses_all_its_targets(noisy):
    assert accuracy(without(noisy, noisy.n == 5), STILL).missing == 12


def test_a_hidden_target_is_not_missing_but_compared_where_it_is_found(noisy):
    hidden = Truth(None, TARGETS, PLACES_MM, TARGETS != 4)
    assert accuracy(without(noisy, noisy.target == 4), hidden).missing == 0
    assert accuracy(noisy, hidden).matched == 2400


def test_truth_of_fields_that_were_not_measured_is_not_missing(noisy):
    longer = STILL.in_fields(np.arange(300))
    assert accuracy(noisy, longer).missing == 0


def test_a_point_with_its_neighbours_id_is_wrong_and_spoils_no_other_number(noisy):
    swapped = noisy.xyz_mm.copy()
    swapped[[0, 1]] = swapped[[1, 0]]
    report = accuracy(Coordinates(noisy.fields, noisy.n, noisy.target, swapped), STILL)
    assert (report.wrong, report.matched, report.missing) == (2, 2398, 0)
    assert report.rmse.xyz_mm == pytest.approx(accuracy(noisy, STILL).rmse.xyz_mm, rel=0.01)


def test_points_of_targets_without_truth_are_unknown(noisy):
    fewer = Truth(None, TARGETS[:-2], PLACES_MM[:-2], np.ones(10, bool))
    report = accuracy(noisy, fewer)
    assert (report.unknown, report.matched) == (400, 2000)


@pytest.mark.parametrize(
    "truth",
    [
        Truth(None, TARGETS + 100, PLACES_MM, np.ones(12, bool)),
        Truth(None, TARGETS, PLACES_MM + 50.0, np.ones(12, bool)),
        Truth(None, TARGETS[:0], PLACES_MM[:0], np.ones(0, bool)),
    ],
    ids=["other ids", "another frame", "no truth"],
)
def test_truth_that_fits_no_point_is_refused(noisy, truth):
    with pytest.raises(MeasurementError, match="none of 2400 points in 200 fields") as refusal:
        accuracy(noisy, truth)
    assert "object's frame" in refusal.value.hint


def test_truth_that_fits_a_few_points_by_chance_is_refused(noisy):
    """Axes exchanged, a few targets are where they are anyway."""
    places = np.where((np.arange(12) == 0)[:, np.newaxis], PLACES_MM, PLACES_MM + 20.0)
    with pytest.raises(MeasurementError, match="200 of 2400 points in 200 fields"):
        accuracy(noisy, Truth(None, TARGETS, places, np.ones(12, bool)))


def test_the_papers_own_table_is_consistent():
    for axes in (PAPER_RMSE, PAPER_PRECISION):
        assert axes.xyz_mm == pytest.approx(np.sqrt(axes.x_mm**2 + axes.y_mm**2 + axes.z_mm**2), abs=2e-3)


def turned(places, degrees, shift_mm):
    angle = np.radians(degrees)
    rotation = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    return places @ rotation.T + shift_mm


def test_a_fit_takes_off_a_motion_however_far_and_leaves_the_noise(noisy):
    moved = replace(noisy, xyz_mm=turned(noisy.xyz_mm, 20.0, (100.0, -7.0, 3.0)))
    report = accuracy(moved, STILL, fit=True)
    assert report.rmse[:3] == pytest.approx(SIGMA_MM, rel=0.05)
    assert report.fitted.angle_deg == pytest.approx(20.0, abs=0.05)
    assert report.matched == 2400


def test_a_fit_never_scales(noisy):
    larger = accuracy(replace(noisy, xyz_mm=1.01 * noisy.xyz_mm), STILL, fit=True)
    assert larger.rmse.xyz_mm > 0.2


def test_a_wrong_id_does_not_pull_the_fit(noisy):
    swapped = noisy.xyz_mm.copy()
    swapped[[0, 1]] = swapped[[1, 0]]
    report = accuracy(replace(noisy, xyz_mm=swapped), STILL, fit=True)
    assert report.wrong == 2
    assert report.rmse.xyz_mm == pytest.approx(accuracy(noisy, STILL, fit=True).rmse.xyz_mm, rel=0.01)


def test_a_truth_of_every_field_in_which_nothing_moves_is_still(noisy):
    fields = STILL.in_fields(noisy.fields)
    assert fields.still
    fields.xyz_mm[5, 2] += 0.001
    assert not fields.still


def test_true_places_stand_beside_the_measured_ones():
    series = series_of(np.zeros((3, 2, 3)), target=[4, 9])
    truth = Truth(
        np.array([1, 1, 2]), np.array([9, 4, 5], np.int32), np.arange(9.0).reshape(3, 3), np.ones(3, bool)
    )
    places = true_places(truth, series)
    assert places[1].tolist() == [[3.0, 4.0, 5.0], [0.0, 1.0, 2.0]]
    assert np.isnan(places[[0, 2]]).all()
