import numpy as np
import pytest

from grabberd.field import Field, quantise
from grabberd.measurement import LocationSettings, measure
from measurement.rendering import TOP, errors_px, grid_of_discs

SETTINGS = LocationSettings(method="edge", line_jitter_px=0.0)


@pytest.fixture(scope="module")
def scene():
    return grid_of_discs(np.random.default_rng(2), diameter_px=5.6, spread_px=0.8, noise=0.02)


def test_its_error_is_as_large_as_it_says(scene):
    field, places = scene
    blobs = measure(quantise(field, 8, 55), None, SETTINGS)
    error, blob = errors_px(blobs, places)
    assert len(error) == len(places)
    assert (np.sqrt((error**2).mean(axis=0)) < (0.026, 0.045)).all()
    in_sigmas = np.sqrt(((error / blobs.sigma_px[blob]) ** 2).mean(axis=0))
    assert ((in_sigmas > 0.7) & (in_sigmas < 1.4)).all()


def test_an_ellipse_that_leans_is_located_in_its_middle():
    y, x = np.mgrid[0:48:2, 0:40].astype(float)
    along, across = (x - 19.3) + 0.3 * (y - 23.6), y - 23.6
    distance = np.hypot(along / 4.0, across / 5.0)
    luma = 20 + 180 / (1 + np.exp((distance - 1) * 7.0))
    blobs = measure(quantise(Field.intact(luma.astype(np.uint8), TOP), 8, 60), None, SETTINGS)
    np.testing.assert_allclose(blobs.xy_px, [[19.3, 23.6]], atol=0.06)
