"""How far the whole picture moves while it is captured."""

import numpy as np
import pytest

from grabberd.core.calibration.mean_images import FieldImages, mean_images, stillness

PLACES = np.stack(np.meshgrid(np.arange(9) * 30.0, np.arange(12) * 40.0), axis=-1).reshape(-1, 2)
NOISE_PX = 0.05


def taken(shift_px, count=24):
    """Fields of both parities; the bottom ones cut the discs elsewhere."""
    rng = np.random.default_rng(1)
    for n in range(count):
        off = np.array([0.0, shift_px(n / (count - 1)) + 0.08 * (n % 2)])
        yield FieldImages(
            PLACES + off + rng.normal(0, NOISE_PX, PLACES.shape), np.full(PLACES.shape, NOISE_PX), n % 2
        )


def measured(shift_px):
    fields = list(taken(shift_px))
    return stillness(fields, mean_images(fields))


def test_noise_and_the_parities_difference_are_no_movement():
    found = measured(lambda _: 0.0)
    assert found.rms_px < 0.02
    assert found.drift_px < 4 * found.drift_sigma_px


def test_a_steady_drift_is_measured_as_such():
    found = measured(lambda share: 0.3 * share)
    assert found.drift_px == pytest.approx(0.3, abs=0.03)
    assert found.rms_px == pytest.approx(0.3 / np.sqrt(12), abs=0.02)


def test_a_creep_of_less_than_a_pixels_twentieth_stands_out_of_the_noise():
    found = measured(lambda share: 0.05 * share)
    assert found.drift_px == pytest.approx(0.05, abs=0.02)
    assert found.drift_px > 5 * found.drift_sigma_px


def test_a_tremble_shows_in_the_rms_and_not_in_the_drift():
    found = measured(lambda share: 0.2 * np.sin(20 * share))
    assert found.rms_px > 0.1
    assert found.drift_px < 0.1


def test_too_few_fields_say_nothing():
    fields = list(taken(lambda share: share / 4, count=2))
    assert stillness(fields, mean_images(fields)).rms_px == 0.0
