"""Locale decoding against discs rendered independently, over random sub-pixel phase."""

import functools
import itertools

import numpy as np
import pytest

from core.measurement.rendering import BOTTOM, TOP, errors_px, grid_of_discs
from grabberd.core.field import Field, double_lines, quantise
from grabberd.core.measurement import LocationSettings, measure
from grabberd.errors import InputError

STEADY = 0.0


@functools.cache
def pictures(*, diameter_px=5.0, noise=0.02, jitter_px=0.0, squeeze=1.0):
    rng = np.random.default_rng(17)
    parities = itertools.islice(itertools.cycle([TOP, BOTTOM]), 2)
    return [
        grid_of_discs(
            rng,
            diameter_px=diameter_px,
            spread_px=0.8,
            noise=noise,
            parity=parity,
            jitter_px=jitter_px,
            squeeze=squeeze,
        )
        for parity in parities
    ]


def errors_and_sigmas(method, *, doubled, fraction=0.2, settings=None, **scene):
    found = []
    for field, places in pictures(**scene):
        packed = quantise(double_lines(field) if doubled else field, 1, round(30 + fraction * 180))
        chosen = LocationSettings(method=method, **(settings or {"line_jitter_px": STEADY}))
        blobs = measure(packed, None, chosen)
        error, blob = errors_px(blobs, places)
        assert len(error) == len(blobs) == len(places)
        found.append((error, blobs.sigma_px[blob]))
    return tuple(np.concatenate(one) for one in zip(*found, strict=True))


def rms_px(method, **scene):
    return np.sqrt((errors_and_sigmas(method, **scene)[0] ** 2).mean(axis=0))


@pytest.mark.parametrize(("doubled", "goal_px"), [(False, (0.12, 0.145)), (True, (0.075, 0.09))])
def test_a_disc_of_five_pixels_is_located_better_than_the_centroid_can(doubled, goal_px):
    locale, centroid = (rms_px(method, doubled=doubled) for method in ("locale", "centroid"))
    assert (locale < goal_px).all()
    assert (locale < centroid).all()


@pytest.mark.parametrize("diameter_px", [4.5, 5.6, 6.5])
@pytest.mark.parametrize("doubled", [False, True])
def test_it_is_never_worse_whatever_the_size(doubled, diameter_px):
    locale, centroid = (
        rms_px(method, doubled=doubled, diameter_px=diameter_px) for method in ("locale", "centroid")
    )
    assert (locale < 1.02 * centroid).all()
    assert (locale**2).sum() < 0.85 * (centroid**2).sum()


@pytest.mark.parametrize("doubled", [False, True])
def test_it_follows_discs_that_are_tilted_by_thirty_degrees(doubled):
    locale, centroid = (rms_px(method, doubled=doubled, squeeze=0.866) for method in ("locale", "centroid"))
    assert (locale < centroid).all()


@pytest.mark.parametrize("fraction", [0.15, 0.3, 0.45])
def test_it_finds_the_height_of_the_threshold_in_doubled_lines(fraction):
    locale, centroid = (rms_px(method, doubled=True, fraction=fraction) for method in ("locale", "centroid"))
    assert (locale < 1.06 * centroid).all()
    assert (locale**2).sum() < 0.9 * (centroid**2).sum()


@pytest.mark.parametrize("noise", [0.02, 0.05, 0.1])
@pytest.mark.parametrize("doubled", [False, True])
def test_its_sigma_is_honest_at_any_noise(doubled, noise):
    error, sigma = errors_and_sigmas("locale", doubled=doubled, noise=noise, fraction=0.3 + noise)
    assert (np.abs(error.mean(axis=0)) < 0.015).all()
    assert ((error / sigma) ** 2).mean(axis=0) == pytest.approx([1.0, 1.0], abs=0.45)


@pytest.mark.parametrize("doubled", [False, True])
def test_line_jitter_is_left_out_of_its_sigma_as_the_later_rooms_add_it(doubled):
    jitter_px = 0.12
    unsolved = {"line_jitter_px": jitter_px, "line_shifts": False}
    scene = {"doubled": doubled, "jitter_px": jitter_px, "settings": unsolved}
    error, sigma = errors_and_sigmas("locale", **scene)
    common = 0.735 * jitter_px * np.sqrt(2 / 2.5)
    found, own = (error**2).mean(axis=0), (sigma**2).mean(axis=0)
    assert found == pytest.approx([own[0] + common**2, own[1]], rel=0.35)


def test_a_blob_that_no_disc_explains_keeps_its_centroid_and_harms_no_other():
    field, _ = pictures()[0]
    luma = field.luma.copy()
    luma[100:104, 300:302] = luma[100:101, 302:306] = 220
    packed = quantise(Field.intact(luma, field.parity), 1, 66)
    locale, centroid = (
        measure(packed, None, LocationSettings(method=one, line_jitter_px=STEADY))
        for one in ("locale", "centroid")
    )
    same = (locale.xy_px == centroid.xy_px).all(axis=1)
    assert 1 <= same.sum() < 5
    np.testing.assert_array_equal(locale.sigma_px[same], centroid.sigma_px[same])


def test_a_target_that_the_edge_cuts_off_keeps_its_centroid():
    field, _ = pictures()[0]
    packed = quantise(Field.intact(field.luma[18:].copy(), TOP), 1, 66)
    locale, centroid = (
        measure(packed, None, LocationSettings(method=one, line_jitter_px=STEADY))
        for one in ("locale", "centroid")
    )
    assert locale.at_border.any()
    np.testing.assert_array_equal(locale.xy_px[locale.at_border], centroid.xy_px[locale.at_border])


@pytest.mark.parametrize("doubled", [False, True])
def test_a_single_target_is_located_too(doubled):
    field, places = pictures(noise=0.0)[0]
    alone = np.full_like(field.luma, 30)
    x, y = places[0]
    rows, columns = slice(int(y / 2) - 6, int(y / 2) + 7), slice(int(x) - 9, int(x) + 10)
    alone[rows, columns] = field.luma[rows, columns]
    lonely = Field.intact(alone, field.parity)
    packed = quantise(double_lines(lonely) if doubled else lonely, 1, 66)
    blobs = measure(packed, None, LocationSettings(method="locale"))
    assert len(blobs) == 1
    assert np.abs(blobs.xy_px - places[0]).max() < 0.35


def test_other_fields_before_it_change_no_bit_of_the_result():
    (field, _), (other, _) = pictures(noise=0.05)
    packed, before = (quantise(one, 1, 66) for one in (field, other))
    settings = LocationSettings(method="locale")
    fresh = measure(packed, None, settings)
    measure(before, None, settings)
    again = measure(packed, None, settings)
    assert again.xy_px.tobytes() == fresh.xy_px.tobytes()
    assert again.sigma_px.tobytes() == fresh.sigma_px.tobytes()


def test_it_is_what_automatic_does_at_one_bit():
    packed = quantise(pictures()[0][0], 1, 66)
    one, other = (measure(packed, None, LocationSettings(method=name)) for name in ("automatic", "locale"))
    np.testing.assert_array_equal(one.xy_px, other.xy_px)


def test_a_field_of_more_bits_is_refused():
    packed = quantise(pictures()[0][0], 4, 66)
    with pytest.raises(InputError, match="'locale' needs fields of 1 bits, not of 4"):
        measure(packed, None, LocationSettings(method="locale"))


@pytest.mark.parametrize("doubled", [False, True])
def test_an_empty_field_has_no_blobs(doubled):
    field = Field.intact(np.full((40, 64), 30, np.uint8), TOP)
    packed = quantise(double_lines(field) if doubled else field, 1, 66)
    assert len(measure(packed, None, LocationSettings(method="locale"))) == 0
