"""The channels of a stream of points."""

import numpy as np
import pytest

from grabberd.documents.points_frame import PointsFrame
from grabberd_lsl.outlets import PointsLayout

LAYOUT = PointsLayout("liner", ((7, 0, 0), (3, 0, 1), (5, 1, 0)))


def field(*targets: int) -> PointsFrame:
    """A field whose points stand at (target, 0.00004, -target) mm."""
    count = len(targets)
    ids = np.array(targets, np.uint32)
    xyz_mm = np.stack((ids.astype(float), np.full(count, 0.00004), -ids.astype(float)), axis=1)
    covariance = np.tile(np.array([0.04, 9, 9, 0.09, 9, 0.16], np.float32), (count, 1))
    return PointsFrame(0, 0, 0, 0, 0, 1, ids, xyz_mm, covariance, covariance, np.zeros(count, np.float32))


def test_targets_keep_their_channels_whichever_are_found() -> None:
    sample = LAYOUT.sample(field(5, 7)).reshape(3, 6)
    assert sample[:, 0].tolist() == pytest.approx([7, np.nan, 5], nan_ok=True)
    assert np.isnan(sample[1]).all()
    assert sample[0, 3:].tolist() == pytest.approx([0.2, 0.3, 0.4])


def test_positions_are_rounded_as_in_a_file() -> None:
    assert LAYOUT.sample(field(7)).reshape(3, 6)[0, 1] == 0


def test_a_field_without_points_is_all_nan() -> None:
    sample = LAYOUT.sample(field())
    assert sample.shape == (18,)
    assert sample.dtype == np.float32
    assert np.isnan(sample).all()


def test_a_target_of_another_object_has_no_channels() -> None:
    assert LAYOUT.covers(field(3))
    assert not LAYOUT.covers(field(3, 8))
    assert np.nanmax(LAYOUT.sample(field(3, 8))) == 3


def test_each_channel_is_described() -> None:
    channels = list(LAYOUT.channels())
    assert len(channels) == LAYOUT.channel_count == 18
    assert channels[9] == ("3_sigma_x", "SigmaX", "millimeters", 3, 0, 1)


def test_other_targets_make_another_stream() -> None:
    document = {"name": "liner", "target": [7, 3, 5], "row": [0, 0, 1], "column": [0, 1, 0]}
    same = PointsLayout.from_document(document)
    other = PointsLayout.from_document({**document, "target": [7, 3, 6]})
    assert (same == LAYOUT, same.digest == LAYOUT.digest) == (True, True)
    assert (other == LAYOUT, other.digest == LAYOUT.digest) == (False, False)
