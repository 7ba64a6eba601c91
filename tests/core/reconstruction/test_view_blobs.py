import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.geometry.rigs import calibration
from core.reconstruction.liners import model
from grabberd.core.geometry import Rig
from grabberd.core.reconstruction import ImageNoise, ViewBlobs
from grabberd.core.reconstruction.points import Common
from grabberd.errors import MeasurementError


def test_a_mask_or_indices_choose_blobs():
    blobs = ViewBlobs(np.arange(6.0).reshape(3, 2), np.ones((3, 2)))
    assert blobs.select(np.array([2, 0])).xy_px.tolist() == [[4.0, 5.0], [0.0, 1.0]]
    assert len(blobs.select(np.array([False, True, False]))) == 1


@pytest.mark.parametrize("sigma", [0.0, -0.1, np.nan])
def test_a_blob_that_claims_to_be_exact_is_refused(sigma):
    with pytest.raises(MeasurementError, match="some of 2 blobs have no position, or no standard deviation"):
        ViewBlobs(np.zeros((2, 2)), np.array([[0.1, 0.1], [0.1, sigma]]))


def test_a_blob_without_a_place_is_refused():
    with pytest.raises(MeasurementError):
        ViewBlobs(np.array([[np.nan, 1.0]]), np.ones((1, 2)))


def test_chosen_blobs_keep_what_they_share():
    blobs = ViewBlobs(np.zeros((3, 2)), np.ones((3, 2)), np.arange(3.0), 4.0)
    assert blobs.select(np.array([2, 0])).common_px.tolist() == [2.0, 0.0]
    assert blobs.select(np.array([2, 0])).common_reach_px == 4.0


sigmas = st.floats(0.02, 0.5)


def covariance(noise, lines, sigma_px):
    """(4, 4) of x left, x right, y left, y right, written down element by element."""
    (sx_left, sx_right), (sy_left, sy_right) = sigma_px
    jitter2 = (0.735 * noise.jitter_px) ** 2 * noise.y_step / noise.radius_lines
    overlap = max(0.0, 1 - abs(lines[0] - lines[1]) / (2 * noise.radius_lines))
    matrix = np.diag([sx_left**2 + jitter2, sx_right**2 + jitter2, sy_left**2, sy_right**2])
    matrix[0, 1] = matrix[1, 0] = overlap * jitter2
    return matrix


@given(st.floats(0, 0.3), st.sampled_from([1, 2]), st.floats(0, 8), st.tuples(sigmas, sigmas, sigmas, sigmas))
def test_whitening_makes_the_four_coordinates_uncorrelated_with_unit_weight(jitter, y_step, apart, sigma):
    noise = ImageNoise(jitter, y_step, 2.9)
    lines, sigma_px = np.array([100.0, 100.0 + apart]), np.array(sigma).reshape(2, 2)
    whitening = noise.whitening(lines[:, np.newaxis], sigma_px[:, :, np.newaxis])
    rows = [whitening.of_values(unit.reshape(2, 2, 1)).ravel() for unit in np.eye(4)]
    root = np.array(rows).T
    assert np.allclose(root @ covariance(noise, lines, sigma_px) @ root.T, np.eye(4), atol=1e-9)


def test_slopes_are_whitened_like_values():
    rng = np.random.default_rng(1)
    whitening = ImageNoise(0.12, 2, 2.9).whitening(
        rng.uniform(0, 3, (2, 5)), rng.uniform(0.1, 0.2, (2, 2, 5))
    )
    slopes = rng.normal(size=(2, 2, 3, 5))
    for index in range(3):
        assert np.array_equal(
            whitening.of_slopes(slopes)[:, :, index], whitening.of_values(slopes[:, :, index])
        )


def test_jitter_of_a_blob_of_five_pixels_in_one_field_is_that_of_the_reference():
    assert abs(ImageNoise(0.12, 2, 2.5).blob_jitter_px - 0.079) < 0.0005


def test_blobs_on_different_lines_share_no_jitter():
    noise = ImageNoise(0.2, 2, 2.0)
    apart = noise.whitening(np.array([[10.0], [14.0]]), np.full((2, 2, 1), 0.1))
    together = noise.whitening(np.array([[10.0], [10.0]]), np.full((2, 2, 1), 0.1))
    assert apart.mixed[0] == 0.0
    assert together.mixed[0] > 0.0


def test_the_radius_of_a_target_is_what_the_rig_makes_of_its_diameter():
    noise = ImageNoise.of(Rig.of(calibration()), model(), 0.12, 2)
    assert 2.7 < noise.radius_lines < 3.1


@given(st.floats(0.01, 0.2), st.floats(0.01, 0.2), st.floats(0, 12), st.floats(1.5, 8))
def test_what_blobs_say_they_share_takes_the_place_of_the_expected(left, right, apart, reach):
    lines, sigma_px = np.array([[100.0], [100.0 + apart]]), np.full((2, 2, 1), 0.1)
    common = Common.of(np.array([[left], [right]]), lines, reach)
    whitening = ImageNoise(0.5, 2, 2.9).whitening(lines, sigma_px, common)
    root = np.array([whitening.of_values(unit.reshape(2, 2, 1)).ravel() for unit in np.eye(4)]).T
    matrix = np.diag([0.01 + left**2, 0.01 + right**2, 0.01, 0.01])
    matrix[0, 1] = matrix[1, 0] = left * right * np.exp(-0.5 * (apart / reach) ** 2)
    assert np.allclose(root @ matrix @ root.T, np.eye(4), atol=1e-9)
