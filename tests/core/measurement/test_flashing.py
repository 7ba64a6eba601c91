"""Places in the picture that go on and off."""

import numpy as np
import pytest

from grabberd.core.field import Field, quantise
from grabberd.core.measurement.noise import TILE_PX, flashing_places, tile_levels

RANDOM = np.random.default_rng(1)
LIT = RANDOM.random(80) < 0.5


def fields(paint, bits=1):
    """Levels of 80 dark fields of 64 × 96 that `paint` has painted into."""
    levels = []
    for n in range(len(LIT)):
        luma = np.full((64, 96), 20, np.uint8)
        paint(luma, n)
        levels.append(tile_levels(quantise(Field.intact(luma, n % 2), bits, 110)))
    return np.stack(levels)


def lamp(luma, n):
    if LIT[n]:
        luma[30:36, 50:60] = 210


def test_a_tile_is_the_mean_of_its_pixels() -> None:
    luma = np.zeros((16, 24), np.uint8)
    luma[8:12, 16:24] = 255
    levels = tile_levels(quantise(Field.intact(luma, 0), 1, 110))
    assert levels.shape == (16 // TILE_PX, 24 // TILE_PX)
    assert levels[1, 2] == pytest.approx(0.5)
    assert levels.sum() == pytest.approx(0.5)


@pytest.mark.parametrize("bits", [1, 2, 8])
def test_a_light_over_several_tiles_is_found_in_its_middle(bits: int) -> None:
    best = flashing_places(fields(lamp, bits), y_step=2)[0]
    assert best.x_px == pytest.approx(54.5, abs=4)
    assert best.y_px == pytest.approx(2 * 32.5, abs=8)
    assert (best.lit == LIT).all()


def test_what_stays_as_it_is_does_not_flash() -> None:
    def target(luma, n):
        luma[10:16, 10:16] = 210

    assert flashing_places(fields(target), y_step=2) == []


def test_what_brightens_slowly_has_no_two_states() -> None:
    def dawn(luma, n):
        luma[:, 40:48] = 20 + 2 * n

    assert flashing_places(fields(dawn, bits=8), y_step=2) == []
