import numpy as np
import pytest

from core.reconstruction.repeated import PX_PER_MM, grid, measured, series_of
from grabberd.core.reconstruction.smoothing import REST, ErrorShares, SmoothingSettings, smooth
from grabberd.errors import MeasurementError

SIGMA_MM = np.array([0.05, 0.04, 0.12])


def pulsation(fields=100, targets=60):
    """(F, T, 3): rest, two millimetres in four fields, rest, back again; every target by its own share."""
    share = np.interp(np.arange(fields) % 50, [0, 15, 20, 35, 40, 50], [0, 0, 1, 1, 0, 0])
    smoothly = 3 * share**2 - 2 * share**3
    depth = np.linspace(0.5, 4.0, targets)
    return grid(targets) + smoothly[:, np.newaxis, np.newaxis] * depth[:, np.newaxis] * np.array(
        [0.1, 0.2, -1.0]
    )


def still(fields=64, targets=60):
    return np.tile(grid(targets), (fields, 1, 1))


def noisy(true, white=0.3, common=0.3, seed=1):
    rng = np.random.default_rng(seed)
    return series_of(
        measured(true, rng, SIGMA_MM * white**0.5, SIGMA_MM * (1 - white) ** 0.5, common), SIGMA_MM
    )


def error_of(result, true):
    return (result.points.xyz_mm - true)[result.measured]


def sigma_ratio(result, true):
    """Root of the mean χ² a coordinate: 1 where the σ given out are the true ones."""
    error, covariance = error_of(result, true), result.series.covariance_mm2[result.measured]
    squares = error * np.linalg.solve(covariance, error[:, :, np.newaxis])[:, :, 0]
    return np.sqrt(squares.sum(axis=1).mean() / 3)


@pytest.mark.parametrize("white", [0.3, 0.6])
@pytest.mark.parametrize("true", [still(), pulsation()], ids=["still", "moving"])
def test_the_given_sigma_is_the_true_one(true, white):
    result = smooth(noisy(true, white))
    assert 0.8 < sigma_ratio(result, true) < 1.25


@pytest.mark.parametrize(
    ("rate_hz", "closes_s"), [(25, 0.15), (60, 0.15), (60, 0.08), (120, 0.15), (120, 0.08)]
)
def test_at_every_rate_a_pulsation_is_smoothed_with_a_true_sigma_and_no_worse_than_single_fields(
    rate_hz, closes_s
):
    time_s = np.arange(2 * rate_hz) / rate_hz
    at = (0, 0.3, 0.3 + closes_s, 0.7, 0.7 + closes_s, 1.0)
    share = np.interp(time_s % 1.0, at, (0, 0, 1, 1, 0, 0))
    path = (3 * share**2 - 2 * share**3)[:, np.newaxis, np.newaxis]
    true = grid(60) + path * np.linspace(0.5, 4.0, 60)[:, np.newaxis] * np.array([0.1, 0.2, -1.0])
    noise = np.random.default_rng(rate_hz).normal(size=true.shape) * SIGMA_MM
    series = series_of(true + noise, SIGMA_MM, rate_hz=rate_hz)
    result = smooth(series, SmoothingSettings(bits=8, interlaced=False, shares=ErrorShares.all_white()))
    assert (error_of(result, true) ** 2).mean(axis=0).max() < (noise**2).mean(axis=0).max()
    assert 0.85 < sigma_ratio(result, true) < 1.2
    assert result.left_out.mean() < 0.001


def test_an_object_that_stands_still_is_seen_to_do_so():
    result = smooth(noisy(still()))
    assert not result.acceleration_mm_s2.any()
    assert np.ptp(result.series.xyz_mm, axis=0).max() < 1e-9


def test_white_noise_of_an_object_at_rest_is_averaged_over_all_fields():
    true = still()
    result = smooth(noisy(true, white=1.0), SmoothingSettings(bits=8))
    assert np.sqrt((error_of(result, true) ** 2).mean(axis=0)) == pytest.approx(SIGMA_MM / 8, rel=0.15)


def test_locked_errors_of_an_object_at_rest_are_not_averaged_and_not_said_to_be():
    true = still()
    result = smooth(noisy(true, white=0.2, common=0.5))
    left = np.sqrt((error_of(result, true) ** 2).mean(axis=0))
    assert (left > 0.5 * SIGMA_MM).all()
    given = np.sqrt(np.diagonal(result.series.covariance_mm2[0], axis1=1, axis2=2).mean(axis=0))
    assert (given > 0.5 * SIGMA_MM).all()


def test_said_to_be_all_white_they_would_be_given_a_sigma_far_too_small():
    true = still()
    settings = SmoothingSettings(shares=ErrorShares.all_white())
    assert sigma_ratio(smooth(noisy(true, white=0.2, common=0.5), settings), true) > 3


def test_smoothing_a_moving_object_halves_its_error_and_leaves_no_lag():
    true = pulsation()
    series = noisy(true, white=0.8)
    result = smooth(series)
    raw = np.sqrt(((series.xyz_mm - true) ** 2).mean())
    assert np.sqrt((error_of(result, true) ** 2).mean()) < 0.6 * raw
    assert np.abs((result.series.xyz_mm - true).mean(axis=1)).max() < 0.2


def test_velocities_are_those_of_the_object():
    true = pulsation()
    result = smooth(noisy(true, white=1.0), SmoothingSettings(bits=8))
    moving = (true[2:] - true[:-2]) / 0.04
    assert np.sqrt(((result.velocity_mm_s[1:-1] - moving) ** 2).mean()) < 6.0


def test_at_rest_it_is_surer_than_in_movement():
    result = smooth(noisy(pulsation(), white=1.0), SmoothingSettings(bits=8))
    variance = np.diagonal(result.series.covariance_mm2, axis1=2, axis2=3)[..., 2]
    assert np.sqrt(variance[17:19].mean() / variance[25:30].mean()) > 1.3


def test_the_calibrations_share_is_handed_on_and_never_averaged():
    series = noisy(still())
    result = smooth(series)
    assert np.array_equal(result.series.calibration_covariance_mm2, series.calibration_covariance_mm2)


def test_gaps_are_bridged_less_surely_and_not_given_out_as_measured():
    true = pulsation()
    gone = np.zeros(true.shape[:2], bool)
    gone[40:46, 5] = True
    gone[:3, 6] = gone[-4:, 6] = True
    result = smooth(noisy(true).without(gone))
    assert not result.measured[40:46, 5].any()
    assert np.isnan(result.points.xyz_mm[40:46, 5]).all()
    bridged = np.diagonal(result.series.covariance_mm2[:, 5], axis1=1, axis2=2)[:, 2]
    assert bridged[42] > 1.2 * bridged[36]
    assert np.abs(result.series.xyz_mm[40:46, 5] - true[40:46, 5]).max() < 0.6
    assert np.isnan(result.series.xyz_mm[[0, 2, -1, -4], 6]).all()


@pytest.mark.parametrize("true", [still(), pulsation()], ids=["still", "moving"])
def test_points_that_contradict_the_others_are_left_out_and_spoil_nothing(true):
    series = noisy(true)
    wild = np.array([[20, 3], [33, 8], [0, 9], [60, 10], [60, 11]])
    series.xyz_mm[wild[:, 0], wild[:, 1]] += [0.3, 0.2, 6.5]
    result = smooth(series)
    assert result.left_out[wild[:, 0], wild[:, 1]].all()
    assert result.left_out.sum() <= len(wild) + 3
    assert 0.8 < sigma_ratio(result, true) < 1.25


def test_lost_fields_count_with_their_time():
    true = pulsation()
    kept = np.delete(np.arange(100), [12, 13, 37, 70, 71, 72])
    series = noisy(true)
    part = type(series)(
        series.n[kept],
        series.time_s[kept],
        series.target,
        *(getattr(series, name)[kept] for name in type(series).__slots__[3:]),
    )
    assert 0.8 < sigma_ratio(smooth(part), true[kept]) < 1.25


@pytest.mark.parametrize("fields", [1, 2, 3])
def test_short_series_are_not_made_better_than_they_are(fields):
    series = noisy(pulsation()[:fields])
    result = smooth(series, SmoothingSettings(acceleration_mm_s2=1000.0))
    smoothed, single = (np.diagonal(one.covariance_mm2, axis1=2, axis2=3) for one in (result.series, series))
    ratio = smoothed / single
    assert ratio.min() > 0.9 / fields
    assert ratio.max() < 1.0 + 1e-6


def test_rest_can_be_demanded():
    result = smooth(noisy(pulsation()), SmoothingSettings(acceleration_mm_s2=REST, gate=1e9))
    assert np.ptp(result.series.xyz_mm, axis=0).max() < 1e-9


def test_without_points_there_is_nothing_to_smooth():
    with pytest.raises(MeasurementError, match="no points to smooth in 4 fields"):
        smooth(series_of(np.full((4, 2, 3), np.nan)))


def test_a_capture_of_a_minute_is_smoothed_as_well_as_one_of_two_seconds():
    true = pulsation(3000, 12)
    result = smooth(noisy(true))
    assert result.measured.all()
    assert 0.8 < sigma_ratio(result, true) < 1.25


def closing_in(fields, count=100, targets=60):
    """(F, T, 3): rest, then eight millimetres within so many fields at one speed, and stopped dead."""
    share = np.clip((np.arange(count) - 40.3) / fields, 0, 1)
    depth = np.linspace(0.0, 8.0, targets)[:, np.newaxis]
    return grid(targets) + share[:, np.newaxis, np.newaxis] * depth * np.array([0.05, 0.2, -1.0])


@pytest.mark.parametrize("lost", [0.0, 0.3])
@pytest.mark.parametrize("fields", [1, 2, 4.5, 7.5])
def test_a_closure_is_smoothed_to_less_than_the_error_of_single_fields(fields, lost):
    true = closing_in(fields)
    series = noisy(true, white=1.0)
    kept = np.random.default_rng(3).random(len(true)) >= lost
    series = type(series)(
        *(getattr(series, name)[kept] if name != "target" else series.target for name in series.__slots__)
    )
    result, true = smooth(series, SmoothingSettings(bits=8)), true[kept]
    single = np.sqrt(((series.xyz_mm - true) ** 2).mean())
    assert np.sqrt((error_of(result, true) ** 2).mean()) < 0.7 * single
    assert 0.75 < sigma_ratio(result, true) < 1.1
    closing = np.abs(series.n - 40.3) < fields + 1
    assert np.sqrt(((result.series.xyz_mm - true)[closing] ** 2).mean()) < 1.05 * single
    assert not result.left_out.any()


def few(targets=4, stroke_mm=3.0, alike=True):
    """(F, T, 3): few targets that move as one, at the same place between the pixels if alike."""
    places = np.round(grid(targets) * PX_PER_MM) / PX_PER_MM + [0.07, 0.11, 0.03] if alike else grid(targets)
    share = np.interp(np.arange(100) % 50, [0, 15, 20, 35, 40, 50], [0, 0, 1, 1, 0, 0])
    smoothly = 3 * share**2 - 2 * share**3
    return places + (stroke_mm * smoothly)[:, np.newaxis, np.newaxis] * np.array([0.1, 0.2, -1.0])


@pytest.mark.parametrize("common", [0.3, 0.9])
@pytest.mark.parametrize("stroke_mm", [0.0, 3.0])
def test_four_targets_that_share_their_locked_error_take_it_for_no_movement(stroke_mm, common):
    """All stand alike between the pixels, so what is locked moves them together, as a wall would."""
    true = few(stroke_mm=stroke_mm)
    for seed in range(3):
        series = noisy(true, common=common, seed=seed)
        result = smooth(series)
        assert 0.75 < sigma_ratio(result, true) < 1.1
        assert (error_of(result, true) ** 2).mean() < 0.75 * ((series.xyz_mm - true) ** 2).mean()
        assert not result.left_out.any()


@pytest.mark.parametrize("common", [0.3, 0.9])
@pytest.mark.parametrize("stroke_mm", [0.0, 3.0])
def test_four_targets_with_locked_errors_of_their_own_are_no_worse_than_single_fields(stroke_mm, common):
    """Their σ is up to a third too small: four targets tell too little of what they have in common."""
    true = few(stroke_mm=stroke_mm, alike=False)
    for seed in range(3):
        series = noisy(true, common=common, seed=seed)
        result = smooth(series)
        assert sigma_ratio(result, true) < 1.5
        assert (error_of(result, true) ** 2).mean() < 0.75 * ((series.xyz_mm - true) ** 2).mean()
