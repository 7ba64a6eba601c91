import numpy as np
import pytest

from grabberd.field import Field, quantise
from grabberd.measurement import LocationSettings, measure
from measurement.rendering import errors_px, grid_of_discs

SETTINGS = LocationSettings(method="correlation", line_jitter_px=0.0)


@pytest.fixture(scope="module")
def scene():
    return grid_of_discs(np.random.default_rng(2), diameter_px=5.6, spread_px=0.8, noise=0.02)


def test_its_error_is_as_large_as_it_says(scene):
    field, places = scene
    blobs = measure(quantise(field, 8, 55), None, SETTINGS)
    error, blob = errors_px(blobs, places)
    assert len(error) == len(places)
    assert (np.sqrt((error**2).mean(axis=0)) < (0.021, 0.024)).all()
    in_sigmas = np.sqrt(((error / blobs.sigma_px[blob]) ** 2).mean(axis=0))
    assert ((in_sigmas > 0.7) & (in_sigmas < 1.4)).all()


def test_a_blob_near_the_edge_of_the_picture_is_located_as_well_as_any(scene):
    field, places = scene
    cut = Field.intact(field.luma[13:, 27:].copy(), field.parity)
    near = measure(quantise(cut, 8, 55), None, SETTINGS)
    error, blob = errors_px(near, places - (27, 26))
    first = ~near.at_border[blob] & (near.xy_px[blob] < 16).any(axis=1)
    assert first.sum() > 20
    assert np.sqrt((error[first] ** 2).mean(axis=0)).max() < 0.04


def test_the_size_of_the_disc_may_be_told(scene):
    field, places = scene
    told = LocationSettings(method="correlation", line_jitter_px=0.0, target_px=5.6)
    error, _ = errors_px(measure(quantise(field, 8, 55), None, told), places)
    assert np.sqrt((error**2).mean(axis=0)).max() < 0.024
