import numpy as np
import pytest

from core.measurement.rendering import TOP, located, rms, small_discs
from grabberd.core.field import Field, quantise
from grabberd.core.measurement import LocationSettings, measure

SETTINGS = LocationSettings(method="edge", line_jitter_px=0.0)


@pytest.fixture(scope="module")
def scene():
    return small_discs()


def test_its_error_is_as_large_as_it_says(scene):
    error, sigma = located(scene, "edge")
    assert len(error) == len(scene[1])
    assert (rms(error) < (0.026, 0.045)).all()
    in_sigmas = rms(error / sigma)
    assert ((in_sigmas > 0.7) & (in_sigmas < 1.4)).all()


def test_an_ellipse_that_leans_is_located_in_its_middle():
    y, x = np.mgrid[0:48:2, 0:40].astype(float)
    along, across = (x - 19.3) + 0.3 * (y - 23.6), y - 23.6
    distance = np.hypot(along / 4.0, across / 5.0)
    luma = 20 + 180 / (1 + np.exp((distance - 1) * 7.0))
    blobs = measure(quantise(Field.intact(luma.astype(np.uint8), TOP), 8, 60), None, SETTINGS)
    np.testing.assert_allclose(blobs.xy_px, [[19.3, 23.6]], atol=0.06)
