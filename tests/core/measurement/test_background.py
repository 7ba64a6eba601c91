import numpy as np
import pytest

from grabberd.core.measurement import background_of


def histogram_of(grey):
    return np.bincount(np.clip(np.round(grey), 0, 255).astype(np.uint8).ravel(), minlength=256)


@pytest.mark.parametrize(("level", "noise"), [(30, 3.6), (60, 1.5), (17, 8.0)])
def test_level_and_noise_are_those_of_the_picture(level, noise):
    grey = np.random.default_rng(1).normal(level, noise, 100_000)
    background = background_of(histogram_of(grey))
    assert background.level == pytest.approx(level, abs=0.1)
    assert background.noise == pytest.approx(noise, rel=0.06)


def test_targets_do_not_change_it_much():
    grey = np.random.default_rng(1).normal(30, 4, 100_000)
    grey[:8_000] = np.linspace(40, 220, 8_000)
    background = background_of(histogram_of(grey))
    assert background.level == pytest.approx(30, abs=0.6)
    assert background.noise == pytest.approx(4, rel=0.1)


def test_black_that_is_clipped_still_shows_its_noise():
    background = background_of(histogram_of(np.random.default_rng(1).normal(0, 5, 100_000)))
    assert background.level == pytest.approx(0, abs=0.5)
    assert background.noise == pytest.approx(5, rel=0.15)


def test_a_picture_without_noise_has_that_of_rounding():
    background = background_of(histogram_of(np.full(10_000, 42)))
    assert background.level == pytest.approx(42, abs=0.5)
    assert 12**-0.5 <= background.noise < 0.5
