"""Many rough cameras at once."""

from dataclasses import replace

import numpy as np
import pytest

from core.calibration.sights import FRAME, NOMINAL
from grabberd.core.calibration.identification.hypothesis_growth import Poses, improved, mirrored, pixels
from grabberd.core.geometry import project

HANDEDNESS = pytest.mark.parametrize("handedness", [1, -1])
ANCHORS = np.array([[150.0, 300.0], [201.0, 122.0]])


def nominal(handedness):
    return NOMINAL.views((handedness, handedness))[0]


@HANDEDNESS
def test_every_target_is_seen_at_every_anchor_in_every_turn(handedness):
    view = nominal(handedness)
    poses = Poses.anchored(view, 4, ANCHORS, FRAME.xyz_mm)
    assert len(poses) == 2 * 4 * len(FRAME)
    target = np.tile(np.arange(len(FRAME)), 8)
    seen = pixels(view, poses.seen_mm(FRAME.xyz_mm[target][:, np.newaxis]))[:, 0]
    np.testing.assert_allclose(seen, np.repeat(ANCHORS, 4 * len(FRAME), axis=0), atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(poses.axes), handedness)


@HANDEDNESS
def test_a_pose_as_a_view_sees_the_same(handedness):
    view = nominal(handedness)
    poses = Poses.anchored(view, 3, ANCHORS[:1], FRAME.xyz_mm[40:42])
    for index in range(len(poses)):
        seen = pixels(view, poses.select(np.array([index])).seen_mm(FRAME.xyz_mm))[0]
        np.testing.assert_allclose(project(poses.view(view, index), FRAME.xyz_mm), seen, atol=1e-9)


@HANDEDNESS
def test_least_squares_lead_to_the_pose_that_sees_the_targets_where_they_are_seen(handedness):
    view = nominal(handedness)
    wanted = view.with_vector(view.vector() + np.array([0] * 3 + [0.1, -0.08, 0.12, 5, -6, 15] + [0] * 9))
    seen = project(wanted, FRAME.xyz_mm)
    poses = Poses.anchored(view, 1, seen[50:51], FRAME.xyz_mm[50:51])
    places = FRAME.xyz_mm[np.newaxis]
    for _ in range(12):
        misfit = seen - pixels(view, poses.seen_mm(places))
        poses = improved(view, poses, places, misfit, np.ones((1, len(FRAME))))
    np.testing.assert_allclose(pixels(view, poses.seen_mm(places))[0], seen, atol=0.01)


def test_a_mirrored_view_shows_the_picture_mirrored_about_the_middle_of_its_half():
    middle = np.array([179.5, 287.5])
    mirror = mirrored(nominal(1), middle)
    np.testing.assert_allclose(mirror.vector(), nominal(-1).vector(), atol=1e-12)
    assert mirror.handedness == -1
    back = mirrored(mirror, middle)
    assert replace(back, b=nominal(1).b).handedness == 1
    np.testing.assert_allclose(back.vector(), nominal(1).vector(), atol=1e-12)


def test_what_lies_behind_a_camera_is_not_seen():
    view = nominal(1)
    poses = Poses.anchored(view, 1, ANCHORS[:1], np.zeros((1, 3)))
    assert np.isnan(pixels(view, poses.seen_mm(np.array([[0.0, 0.0, 600.0]])))).all()
