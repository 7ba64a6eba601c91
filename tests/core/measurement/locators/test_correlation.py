import pytest

from core.measurement.rendering import errors_px, located, rms, small_discs
from grabberd.core.field import Field, quantise
from grabberd.core.measurement import LocationSettings, measure

SETTINGS = LocationSettings(method="correlation", line_jitter_px=0.0)


@pytest.fixture(scope="module")
def scene():
    return small_discs()


def test_its_error_is_as_large_as_it_says(scene):
    error, sigma = located(scene, "correlation")
    assert len(error) == len(scene[1])
    assert (rms(error) < (0.021, 0.024)).all()
    in_sigmas = rms(error / sigma)
    assert ((in_sigmas > 0.7) & (in_sigmas < 1.4)).all()


def test_a_blob_near_the_edge_of_the_picture_is_located_as_well_as_any(scene):
    field, places = scene
    cut = Field.intact(field.luma[13:, 27:].copy(), field.parity)
    near = measure(quantise(cut, 8, 55), None, SETTINGS)
    error, blob = errors_px(near, places - (27, 26))
    first = ~near.at_border[blob] & (near.xy_px[blob] < 16).any(axis=1)
    assert first.sum() > 20
    assert rms(error[first]).max() < 0.04


def test_the_size_of_the_disc_may_be_told(scene):
    error, _ = located(scene, "correlation", target_px=5.6)
    assert rms(error).max() < 0.024
