"""Targets of any size are targets, if the rig lets them be expected."""

import re
from dataclasses import replace

import numpy as np
import pytest

from core.chain.sized_pictures import Picture, fields
from core.shipped_models import PAPER, shipped_document
from grabberd.core.chain.calibration.calibrate import calibrate
from grabberd.core.chain.calibration.frame_capture import identify
from grabberd.core.chain.locating import LEAST_PX, px_per_mm, px_per_mm_of, sized
from grabberd.core.chain.measure import MeasureSetup, measure_fields, measured_groups
from grabberd.core.geometry import Calibration
from grabberd.core.measurement import LocationSettings
from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import MeasurementError

HD = Picture(1920, 1080, 0.0031)
"""A disc of 1.5 mm is 15.6 px wide: it was larger than any target used to be."""
VGA = Picture(640, 480, 0.0160)
"""It is 3.0 px wide."""


def frame() -> ObjectModel:
    """The paper's calibration frame at a pitch of 6.5 mm each way, which 1080 lines hold, half as deep."""
    paper = shipped_document(PAPER)
    targets = [
        target | {"x_mm": 6.5 * (target["row"] - 5.5), "z_mm": target["z_mm"] / 2}
        for target in paper["targets"]
    ]
    return ObjectModel.from_document(paper | {"targets": targets})


FRAME = frame()
NO_COVARIANCE = np.zeros((36, 36))


@pytest.mark.parametrize("bits", [1, 8])
@pytest.mark.parametrize("camera", [HD, VGA], ids=["1920x1080, 15 px", "640x480, 3 px"])
def test_every_target_is_located_and_identified(camera, bits):
    shown = camera.draw(FRAME.xyz_mm, FRAME.target_diameter_mm)
    seen = identify(fields(shown, bits), camera.nominal, FRAME)
    assert seen.refusal is None
    for side, images, target in zip((-1, 1), seen.images, seen.target, strict=True):
        assert sorted(target) == list(range(108))
        off_px = images.xy_px - camera.project(FRAME.xyz_mm, side)[target]
        assert np.sqrt((off_px**2).mean()) < 0.3


@pytest.mark.parametrize("camera", [HD, VGA], ids=["1920x1080, 15 px", "640x480, 3 px"])
def test_every_target_is_measured(camera):
    shown = camera.draw(FRAME.xyz_mm, FRAME.target_diameter_mm)
    for one in measure_fields(fields(shown, 8), MeasureSetup(known(camera), FRAME)):
        assert one.points.target.tolist() == FRAME.target.tolist()
        assert np.sqrt(((one.points.xyz_mm - FRAME.xyz_mm) ** 2).mean()) < 0.03


def known(camera: Picture) -> Calibration:
    left, right = camera.nominal.views()
    return Calibration(
        "drawn", "2026-01-01T00:00:00Z", "polygons", camera.columns, camera.lines, left, right, NO_COVARIANCE
    )


def test_the_expected_size_is_that_of_the_rig():
    # A disc seen square on from 240 mm by a lens of 8 mm is 1/30 as large: .05 mm, 5 pixels of .01 mm.
    square_on = replace(VGA.nominal, base_mm=1e-9, pixel_x_mm=0.01, pixel_y_mm=0.01)
    assert px_per_mm(square_on) * 1.5 == pytest.approx(5.0)
    assert px_per_mm(HD.nominal) == pytest.approx(px_per_mm_of(HD.nominal.views()), rel=0.1)


def test_stated_limits_stand():
    stated = LocationSettings(min_diameter_px=1.0, max_diameter_px=99.0)
    assert sized(stated, px_per_mm(HD.nominal), 1.5) == stated
    one = sized(LocationSettings(max_diameter_px=99.0), px_per_mm(HD.nominal), 1.5)
    assert one.limits_px[0] < 15 < one.limits_px[1] == 99.0


def test_a_single_pixel_of_noise_is_never_a_target():
    assert sized(LocationSettings(), px_per_mm(VGA.nominal), 0.1).limits_px[0] == LEAST_PX


@pytest.mark.parametrize("diameter_mm", [4.3, 0.4])
def test_targets_of_another_size_are_told_with_their_size(diameter_mm):
    shown = HD.draw(FRAME.xyz_mm, diameter_mm)
    with pytest.raises(MeasurementError) as caught:
        calibrate([fields(shown, 8)], HD.nominal, FRAME)
    told = re.search(
        r"left view shows 108 blobs of .* px \((.*) to (.*) mm on .* and none of", caught.value.message
    )
    # Spread and a low threshold make a blob wider than its disc by up to two pixels, .2 mm.
    assert float(told[1]) - 0.2 < diameter_mm < float(told[2]) + 0.1
    assert "least_mm" in caught.value.hint
    assert identify(fields(shown, 8), HD.nominal, FRAME).refusal.message == caught.value.message


def test_a_dark_view_is_still_called_dark():
    shown = HD.draw(FRAME.xyz_mm[:0], 1.5)
    with pytest.raises(MeasurementError, match="dark"):
        calibrate([fields(shown, 8)], HD.nominal, FRAME)


def test_a_measurement_without_points_tells_the_sizes():
    shown = HD.draw(FRAME.xyz_mm, 4.3)
    with pytest.raises(MeasurementError, match=r"no target .* 108 blobs of 4\d\.\d to 4\d\.\d px"):
        list(measured_groups(fields(shown, 8), MeasureSetup(known(HD), FRAME)))
