"""The simulator's optics and the program's functional model share no formula, and agree."""

import numpy as np
import pytest

from grabberd.core.geometry import Calibration, project
from grabberd_fake import FakeOptions, truth_at
from grabberd_fake.__main__ import calibration_document
from grabberd_fake.optics import build_views

TIME_NS = 123_450_000_000


@pytest.mark.parametrize("reflections", [1, 2], ids=["handedness -1", "handedness +1"])
@pytest.mark.parametrize("scene", ["calibration_frame", "liner", "accuracy_object"])
def test_mirrored_rays_and_virtual_cameras_give_the_same_picture(reflections: int, scene: str) -> None:
    options = FakeOptions.read({"scene": scene, "rig": {"reflections": reflections, "mirror_error_px": 0}})
    calibration = Calibration.from_document(calibration_document(options))
    truth = truth_at(options, TIME_NS)
    for view, seen in zip(calibration.views, (truth.left_px, truth.right_px), strict=True):
        assert view.handedness == (1 if reflections == 2 else -1)
        off = project(view, truth.xyz_mm) - seen
        assert np.abs(off).max() < 0.05, "the centre of a disc's image is not the image of its centre"
        assert np.sqrt((off**2).mean()) < 0.01


@pytest.mark.parametrize("reflections", [1, 2], ids=["handedness -1", "handedness +1"])
def test_a_points_image_agrees_to_a_millionth_of_a_pixel(reflections: int) -> None:
    options = FakeOptions.read({"rig": {"reflections": reflections, "mirror_error_px": 0}})
    calibration = Calibration.from_document(calibration_document(options))
    points = np.random.default_rng(1).uniform((-60, -30, -25), (60, 30, 10), (500, 3))
    for view, optics in zip(calibration.views, build_views(options), strict=True):
        seen = optics.image(points)
        assert np.abs(project(view, points) - seen).max() < 1e-6
