"""The predicted standard deviation against the RMS error of rendered discs, over random sub-pixel phase."""

import functools
import itertools

import numpy as np
import pytest

from core.measurement.rendering import BOTTOM, TOP, errors_px, grid_of_discs
from grabberd.core.field import double_lines, quantise
from grabberd.core.measurement import LocationSettings, measure
from grabberd.core.measurement.noise import binary_sigma_px, grey_sigma_px

DIAMETERS_PX = (4.0, 4.5, 5.0, 5.6, 6.3)
FACTOR = np.array([1.35, 1.6])


@functools.cache
def pictures(noise, spread_px=0.8):
    rng = np.random.default_rng(11)
    parities = itertools.cycle([TOP, BOTTOM])
    return [
        grid_of_discs(rng, diameter_px=diameter_px, spread_px=spread_px, noise=noise, parity=next(parities))
        for diameter_px in DIAMETERS_PX
    ]


def predicted_and_empirical(*, bits, doubled, fraction, noise):
    """RMS over a mixture of target sizes and both parities: two (2,) arrays x, y."""
    sigmas, errors = [], []
    for field, places in pictures(noise):
        packed = quantise(double_lines(field) if doubled else field, bits, round(30 + fraction * 180))
        blobs = measure(packed, None, LocationSettings(method="centroid", line_jitter_px=0.0))
        error, blob = errors_px(blobs, places)
        assert len(error) == len(places)
        sigmas.append(blobs.sigma_px[blob])
        errors.append(error)
    return (np.sqrt(np.mean(np.concatenate(values) ** 2, axis=0)) for values in (sigmas, errors))


def ratio(predicted, empirical):
    """How many times one is the other, at least 1."""
    return np.maximum(predicted / empirical, empirical / predicted)


@pytest.mark.parametrize("noise", [0.02, 0.05])
@pytest.mark.parametrize("fraction", [0.2, 0.35, 0.5])
@pytest.mark.parametrize("doubled", [False, True])
def test_one_bit(doubled, fraction, noise):
    assert (
        ratio(*predicted_and_empirical(bits=1, doubled=doubled, fraction=fraction, noise=noise)) < FACTOR
    ).all()


@pytest.mark.parametrize("noise", [0.005, 0.02, 0.05])
@pytest.mark.parametrize("fraction", [0.13, 0.25, 0.5])
def test_eight_bits_on_intact_rows(fraction, noise):
    assert (
        ratio(*predicted_and_empirical(bits=8, doubled=False, fraction=fraction, noise=noise)) < FACTOR
    ).all()


@pytest.mark.parametrize("noise", [0.02, 0.05])
@pytest.mark.parametrize("fraction", [0.13, 0.25])
def test_eight_bits_on_doubled_rows(fraction, noise):
    assert (
        ratio(*predicted_and_empirical(bits=8, doubled=True, fraction=fraction, noise=noise)) < FACTOR
    ).all()


def test_five_bits():
    assert (ratio(*predicted_and_empirical(bits=5, doubled=False, fraction=0.13, noise=0.03)) < FACTOR).all()


def test_four_bits_whose_steps_hide_the_noise():
    assert (ratio(*predicted_and_empirical(bits=4, doubled=False, fraction=0.13, noise=0.03)) < 1.8).all()


def test_the_formula_of_the_binary_centroid_for_five_pixels():
    area = np.array([np.pi / 4 * 5**2])
    assert binary_sigma_px(area, 2, doubled=False)[0] == pytest.approx([0.134, 0.190], abs=0.0005)
    assert binary_sigma_px(area, 1, doubled=True)[0] == pytest.approx([0.105, 0.109], abs=0.0005)


def test_the_formula_of_the_grey_centroid_for_a_sharp_disc():
    radius, window, noise, contrast, rows = 2.5, 3.2, 4.0, 200.0, 2
    sigma = grey_sigma_px(
        np.array([np.pi * window**2]),
        np.array([contrast * np.pi * radius**2 / rows]),
        rows,
        doubled=False,
        noise=noise,
        threshold_height=0.0,
    )
    expected = 0.282 * np.sqrt(rows) * (window / radius) ** 2 * noise / contrast
    assert sigma[0] == pytest.approx([expected, expected], rel=0.001)


def test_sigma_grows_with_noise_and_with_the_threshold():
    def sigma(noise, height):
        return grey_sigma_px(
            np.array([30.0]), np.array([2000.0]), 2, doubled=False, noise=noise, threshold_height=height
        ).max()

    assert sigma(2.0, 20.0) < sigma(4.0, 20.0)
    assert sigma(2.0, 20.0) < sigma(2.0, 60.0)
