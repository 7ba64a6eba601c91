import numpy as np
import pytest

from core.measurement.rendering import BOTTOM, TOP, errors_px, grid_of_discs
from grabberd.core.field import BIT_DEPTHS, Field, double_lines, quantise
from grabberd.core.measurement import LocationSettings, measure

METHODS = ("vernier", "tian-huhns")
TRUE_X, TRUE_Y = 20.3, 25.6


def lone_disc(parity):
    """A Gaussian blob of known place, in the lines of one parity."""
    y, x = np.mgrid[:64, :48]
    light = 200 * np.exp(-((x - TRUE_X) ** 2 + (y - TRUE_Y) ** 2) / 12)
    return Field.intact(light[parity::2].astype(np.uint8), parity)


def located(field, method, bits, threshold=60):
    settings = LocationSettings(method=method, line_jitter_px=0.0)
    return measure(quantise(field, bits, threshold), None, settings)


@pytest.mark.parametrize("parity", [TOP, BOTTOM])
@pytest.mark.parametrize("method", METHODS)
def test_a_blob_is_found_between_the_pixels_whatever_the_parity(method, parity):
    blobs = located(lone_disc(parity), method, 8)
    np.testing.assert_allclose(blobs.xy_px, [[TRUE_X, TRUE_Y]], atol=0.1)


@pytest.mark.parametrize("method", METHODS)
def test_interpolated_lines_add_nothing(method):
    field = lone_disc(TOP)
    intact, doubled = (located(one, method, 8).xy_px for one in (field, double_lines(field)))
    np.testing.assert_allclose(intact, doubled, atol=0.12)


@pytest.mark.parametrize("bits", BIT_DEPTHS)
@pytest.mark.parametrize("method", METHODS)
def test_they_take_any_number_of_bits(method, bits):
    blobs = located(lone_disc(TOP), method, bits)
    np.testing.assert_allclose(blobs.xy_px, [[TRUE_X, TRUE_Y]], atol=0.6)


@pytest.mark.parametrize(("noise", "limit_px"), [(0.02, 0.12), (0.05, 0.15)])
@pytest.mark.parametrize("diameter_px", [4.0, 5.0, 6.0])
@pytest.mark.parametrize("method", METHODS)
def test_on_grey_discs_they_are_as_good_as_their_sigma_says(method, diameter_px, noise, limit_px):
    rng = np.random.default_rng(13)
    field, places = grid_of_discs(rng, diameter_px=diameter_px, spread_px=0.8, noise=noise)
    blobs = located(field, method, 8, threshold=54)
    error, blob = errors_px(blobs, places)
    assert len(error) == len(places)
    rms, sigma = (np.sqrt((values**2).mean(axis=0)) for values in (error, blobs.sigma_px[blob]))
    assert (rms < limit_px).all()
    assert (rms < 1.5 * sigma).all()


@pytest.mark.parametrize("method", METHODS)
def test_a_field_without_targets_has_no_blobs(method):
    assert len(located(Field.intact(np.full((20, 30), 10, np.uint8), TOP), method, 8)) == 0
