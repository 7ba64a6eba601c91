import numpy as np
import pytest

from grabberd.errors import MeasurementError
from grabberd.reconstruction import ViewBlobs


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
