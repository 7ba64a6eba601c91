from dataclasses import replace

import numpy as np
import pytest

from core.measurement.rendering import grid_of_discs, located, rms, small_discs
from grabberd.core.field import double_lines
from grabberd.core.measurement.locators.template import disc_images


@pytest.fixture(scope="module")
def scene():
    return small_discs()


def test_the_derivatives_are_those_of_the_picture():
    """Of all but what bends the edge; the distance from an ellipse is only nearly what it is taken for."""
    disc = np.array([6.2, 7.1, 150.0, 20.0, 2.9, 2.7, 0.05, 0.9])[:, np.newaxis]
    place = np.arange(13, dtype=np.float32), np.arange(0, 14, 2, dtype=np.float32)
    _, slopes = disc_images(disc.astype(np.float32), *place, 0.72)
    for index, step in ((0, 0.05), (1, 0.05), (2, 1.0), (3, 1.0)):
        moved = np.repeat(disc, 2, axis=1)
        moved[index] += (-step, step)
        before, after = disc_images(moved.astype(np.float32), *place, 0.72)[0]
        numeric = (after - before) / (2 * step)
        np.testing.assert_allclose(slopes[0, index], numeric, atol=0.12 * np.abs(numeric).max())


def test_its_error_is_what_the_noise_allows_and_as_large_as_it_says(scene):
    error, sigma = located(scene, "template")
    assert (rms(error) < (0.020, 0.022)).all()
    in_sigmas = rms(error / sigma)
    assert ((in_sigmas > 0.85) & (in_sigmas < 1.15)).all()


@pytest.mark.parametrize("diameter_px", [4.0, 8.0])
def test_the_size_of_the_targets_need_not_be_known(diameter_px):
    scene = grid_of_discs(np.random.default_rng(4), diameter_px=diameter_px, noise=0.02)
    error, sigma = located(scene, "template")
    assert (rms(error) < (0.022, 0.04)).all()
    assert rms(error / sigma).max() < 1.6


@pytest.mark.parametrize("spread_px", [0.6, 1.0])
def test_a_spread_that_is_not_quite_right_does_little_harm(scene, spread_px):
    assert rms(located(scene, "template", spread_px=spread_px)[0]).max() < 0.028


@pytest.mark.parametrize("method", ["template", "weighted", "edge", "correlation"])
@pytest.mark.parametrize("bits", [4, 6])
def test_fewer_bits_are_worse_and_say_so(scene, method, bits):
    fine, _ = located(scene, method)
    coarse, sigma = located(scene, method, bits)
    assert rms(coarse).max() > 0.9 * rms(fine).max()
    assert rms(coarse / sigma).max() < 1.6


def test_doubled_lines_add_nothing_and_take_nothing_away(scene):
    field, places = scene
    doubled, _ = located((double_lines(field), places), "template")
    assert (rms(doubled) < (0.020, 0.023)).all()


@pytest.mark.parametrize("beside", [(6, 0), (-6, 2), (7, -4)])
def test_a_narrow_disc_is_not_drawn_to_the_light_of_its_neighbour(beside):
    """Discs that lean by seventy degrees, as at the edge of a round wall, in pairs whose blobs are apart.

    Windows are as large as the discs above them ask for, which face the camera.
    """
    known = {"diameter_px": 5.5, "noise": 0.01}
    facing, _ = grid_of_discs(np.random.default_rng(5), **known)
    narrow, places = grid_of_discs(np.random.default_rng(6), **known, squeeze=0.35, beside=beside)
    below = facing.luma.shape[0] // 2
    field = replace(narrow, luma=np.concatenate([facing.luma[:below], narrow.luma[below:]]))
    error, sigma = located((field, places[places[:, 1] > 2 * below + 10]), "template")
    assert np.abs(error.mean(axis=0)).max() < 0.02
    assert rms(error).max() < 0.03
    assert rms(error / sigma).max() < 1.4
