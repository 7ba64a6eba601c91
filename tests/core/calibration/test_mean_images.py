"""Mean places of what stands still, and how well they are known."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grabberd.core.calibration.mean_images import FieldImages, mean_images
from grabberd.errors import MeasurementError

TRUE = np.stack(np.meshgrid(np.arange(40, 320, 25.0), np.arange(60, 520, 38.0)), axis=-1).reshape(-1, 2)


def capture(count, noise=0.05, locked=0.0, seed=0, shown=TRUE, sigma=None, jitter=0.0):
    """Fields of both parities by turns, each target with a locked error that is partly common to both.

    In x that part is as large as the one that differs in sign; in y it has .6 of its variance.
    """
    rng = np.random.default_rng(seed)
    common, opposite = rng.normal(0, 1, (2, len(shown), 2)) * locked
    fixed = common * np.sqrt([1 / 2, 3 / 8]), opposite * np.sqrt([1 / 2, 5 / 8])
    stated = np.hypot(noise, locked) if sigma is None else sigma
    fields = []
    for n in range(count):
        seen = shown + fixed[0] + (-1) ** n * fixed[1] + rng.normal(0, 1, shown.shape) * noise
        seen[:, 0] += rng.normal(0, 1, len(shown)) * jitter
        fields.append(FieldImages(seen, np.full(shown.shape, stated), n % 2, jitter))
    return fields


def whitened(fields):
    mean = mean_images(fields)
    return np.sqrt((((mean.xy_px - TRUE) / mean.sigma_px) ** 2).mean()), mean


def test_noise_is_divided_by_the_number_of_fields():
    ratio, mean = whitened(capture(64, noise=0.08, sigma=0.08))
    assert 0.85 < ratio < 1.2
    assert np.median(mean.sigma_px) == pytest.approx(0.08 / 8, rel=0.35)
    np.testing.assert_allclose(np.median(mean.scatter_px), 0.08, rtol=0.05)


def test_of_the_locked_error_the_part_common_to_both_parities_stays():
    few, many = (whitened(capture(n, noise=0.02, locked=0.14)) for n in (8, 200))
    assert 0.85 < few[0] < 1.15
    assert 0.85 < many[0] < 1.15
    np.testing.assert_allclose(np.median(many[1].sigma_px, axis=0), 0.14 * np.sqrt([1 / 2, 3 / 8]), rtol=0.1)


@pytest.mark.parametrize("stated", [0.05, 0.1, 0.3])
def test_it_is_told_by_the_parities_whatever_is_expected_of_a_field(stated):
    ratio, _ = whitened(capture(32, noise=0.05, locked=0.07, sigma=stated))
    assert 0.85 < ratio < 1.15


def test_parities_that_agree_have_no_locked_error_though_less_scatters_than_expected():
    ratio, mean = whitened(capture(64, noise=0.05, sigma=0.055))
    assert 0.85 < ratio < 1.15
    assert np.median(mean.sigma_px) == pytest.approx(0.05 / 8, rel=0.15)


def test_of_doubled_lines_three_times_as_much_is_common_in_x():
    plain = capture(64, noise=0.02, locked=0.1)
    intact, doubled = (
        mean_images([replace(one, is_doubled=kind) for one in plain]) for kind in (False, True)
    )
    ratio = np.median(doubled.sigma_px / intact.sigma_px, axis=0)
    np.testing.assert_allclose(ratio, np.sqrt([3.0, 0.55]), rtol=0.05)


def test_a_target_that_one_parity_shows_cut_off_says_nothing_of_the_others():
    fields, cut = capture(64), TRUE.copy()
    cut[:3] += 0.8
    shown = [one if one.parity else other for one, other in zip(fields, capture(64, shown=cut), strict=True)]
    np.testing.assert_allclose(mean_images(shown).sigma_px[3:], mean_images(fields).sigma_px[3:], rtol=0.1)


def test_one_parity_alone_halves_nothing():
    fields = [one for one in capture(100, noise=0.01, locked=0.14) if one.parity == 0]
    ratio, mean = whitened(fields)
    assert 0.85 < ratio < 1.15
    assert np.median(mean.sigma_px) == pytest.approx(0.14, rel=0.05)


@settings(max_examples=12)
@given(
    st.sampled_from([4, 16, 60]),
    st.floats(0.02, 0.15),
    st.floats(0.0, 0.2),
    st.floats(0, 0.1),
    st.integers(0),
)
def test_the_stated_sigma_is_the_true_one_whatever_it_is_made_of(count, noise, locked, jitter, seed):
    ratio, _ = whitened(capture(count, noise, locked, seed % 1000, jitter=jitter))
    assert 0.7 < ratio < 1.45


def test_the_line_jitter_of_a_single_field_is_in_its_sigma():
    ratio, mean = whitened(capture(1, noise=0.02, jitter=0.08))
    assert 0.8 < ratio < 1.2
    assert np.isnan(mean.scatter_px).all()
    np.testing.assert_allclose(mean.sigma_px[:, 0], np.hypot(0.02, 0.08))
    np.testing.assert_allclose(mean.sigma_px[:, 1], 0.02)


def test_the_order_of_blobs_does_not_matter_and_missing_ones_are_counted():
    rng = np.random.default_rng(3)
    fields = []
    for one in capture(40):
        kept = rng.permutation(len(TRUE))[: round(0.9 * len(TRUE))]
        fields.append(FieldImages(one.xy_px[kept], one.sigma_px[kept], one.parity))
    mean = mean_images(fields)
    order = np.lexsort(mean.xy_px.round().T[::1])
    np.testing.assert_allclose(mean.xy_px[order], TRUE[np.lexsort(TRUE.T[::1])], atol=0.1)
    assert mean.fields.sum() == sum(len(one.xy_px) for one in fields)
    assert mean.fields.max() <= mean.of_fields == 40
    assert mean.dropped == 0


def test_false_blobs_of_few_fields_are_dropped_and_counted():
    rng = np.random.default_rng(4)
    fields = [
        FieldImages(
            np.vstack([one.xy_px, rng.uniform((330, 0), (359, 575), (3, 2))]),
            0.1 * np.ones((len(TRUE) + 3, 2)),
            n % 2,
        )
        for n, one in enumerate(capture(30))
    ]
    mean = mean_images(fields)
    assert len(mean) == len(TRUE)
    assert mean.dropped == 90


def test_a_target_that_only_one_parity_shows_is_kept_with_its_own_sigma():
    low = np.append(TRUE, [[345.0, 300.0]], axis=0)
    both = zip(capture(40), capture(40, shown=low), strict=True)
    mean = mean_images([one if one.parity == 0 else other for one, other in both])
    assert len(mean) == len(TRUE) + 1
    assert mean.fields[-1] == 20
    assert mean.sigma_px[-1].mean() > 1.2 * mean.sigma_px[:-1].mean()


def test_a_capture_without_blobs_has_no_means():
    assert len(mean_images([FieldImages(np.empty((0, 2)), np.empty((0, 2)), n % 2) for n in range(4)])) == 0
    assert len(mean_images([])) == 0


def test_a_dark_field_is_none_that_moved():
    fields = capture(20)
    fields[7] = FieldImages(fields[7].xy_px[:5], fields[7].sigma_px[:5], 1)
    assert mean_images(fields).fields.max() == 20


@pytest.mark.parametrize("from_field", [3, 10, 17])
def test_a_frame_that_was_pushed_is_said_to_have_moved(from_field):
    fields = [
        FieldImages(one.xy_px + (6.0 if n >= from_field else 0.0), one.sigma_px, one.parity)
        for n, one in enumerate(capture(20))
    ]
    with pytest.raises(
        MeasurementError, match=r"the calibration frame moved: field \d+ of parity \d shows 156 blobs"
    ):
        mean_images(fields)


def shifted(one, along, across):
    return FieldImages(one.xy_px + np.array([along, across]), one.sigma_px, one.parity)


def test_a_frame_that_drifts_is_said_to_have_moved():
    fields = [shifted(one, 0.0, 0.05 * n) for n, one in enumerate(capture(40))]
    with pytest.raises(MeasurementError, match=r"moved: field \d+ of parity \d is shifted by \(-?0\.\d\d, "):
        mean_images(fields)


def test_parities_two_lines_apart_are_a_wrong_field_order():
    fields = [shifted(one, 0.0, 2.0 * one.parity) for one in capture(20)]
    with pytest.raises(MeasurementError, match=r"2\.0 frame lines apart: the field order is wrong"):
        mean_images(fields)
