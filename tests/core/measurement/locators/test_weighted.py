import numpy as np
import pytest

from core.measurement.rendering import BOTTOM, TOP, errors_px, grid_of_discs, located, rms, small_discs
from grabberd.core.field import Field, double_lines, quantise
from grabberd.core.measurement import LocationSettings, measure
from grabberd.errors import InputError

SETTINGS = LocationSettings(method="weighted", line_jitter_px=0.0)
THRESHOLD = 55


@pytest.fixture(scope="module")
def scene():
    return small_discs()


def test_its_error_is_near_what_the_noise_allows_and_nearly_as_large_as_it_says(scene):
    error, sigma = located(scene, "weighted")
    assert len(error) == len(scene[1])
    assert (rms(error) < (0.022, 0.028)).all()
    in_sigmas = rms(error / sigma)
    assert ((in_sigmas > 0.85) & (in_sigmas < 1.5)).all()


def test_the_threshold_does_not_matter(scene):
    field, places = scene
    low, high = (errors_px(measure(quantise(field, 8, t), None, SETTINGS), places)[0] for t in (45, 110))
    np.testing.assert_allclose(low, high, atol=0.01)


def test_doubled_lines_add_nothing_and_take_nothing_away(scene):
    field, places = scene
    intact, doubled = (
        errors_px(measure(quantise(one, 8, THRESHOLD), None, SETTINGS), places)[0]
        for one in (field, double_lines(field))
    )
    np.testing.assert_allclose(intact, doubled, atol=0.02)


@pytest.mark.parametrize("parity", [TOP, BOTTOM])
def test_both_parities_are_located_in_frame_lines(parity):
    field, places = grid_of_discs(np.random.default_rng(3), parity=parity)
    error, _ = errors_px(measure(quantise(field, 8, THRESHOLD), None, SETTINGS), places)
    assert np.abs(error.mean(axis=0)).max() < 0.01


def test_a_blob_at_the_edge_of_the_picture_is_located_with_what_is_there():
    luma = np.full((24, 40), 20, np.uint8)
    luma[0:3, 0:5] = 200
    blobs = measure(quantise(Field.intact(luma, TOP), 8, 100), None, SETTINGS)
    np.testing.assert_allclose(blobs.xy_px, [[2.0, 2.0]], atol=0.05)
    assert blobs.at_border.all()


@pytest.mark.parametrize("method", ["weighted", "template", "edge", "correlation"])
def test_one_bit_is_refused_with_what_would_do(scene, method):
    with pytest.raises(InputError, match=f"method '{method}' needs fields of 2, 3") as refused:
        measure(quantise(scene[0], 1, THRESHOLD), None, LocationSettings(method=method))
    assert "automatic" in refused.value.hint


@pytest.mark.parametrize("method", ["weighted", "template", "edge", "correlation"])
def test_an_empty_field_has_no_blobs(method):
    dark = quantise(Field.intact(np.full((24, 40), 20, np.uint8), TOP), 8, 100)
    assert len(measure(dark, None, LocationSettings(method=method))) == 0
