"""Pictures of the calibration frame by the simulated grabber: from fields to identified means."""

from functools import cache

import numpy as np
import pytest

from core.calibration.sights import FRAME, roughly
from grabberd.core.calibration.identification.frame_identification import identify_frame
from grabberd.core.calibration.mean_images import FieldImages, mean_images
from grabberd.core.field import Field, double_lines, quantise
from grabberd.core.measurement import LocationSettings, ThresholdRule, choose_threshold, measure
from grabberd_fake import FakeGrabber, JumpingClock, truth_at

SEAM_PX = 359.5


@cache
def pictures(reflections, count=12):
    """The options of a simulated grabber, and fields of it."""
    options = {"scene": "calibration_frame", "pace": "free", "rig": {"reflections": reflections}}
    grabber = FakeGrabber(clock=JumpingClock(), **options)
    grabber.open()
    fields = []
    while len(fields) < count:
        with grabber.dequeue(1.0) as grabbed:
            fields += [Field.intact(one.field.luma.copy(), one.field.parity) for one in grabbed]
    grabber.close()
    return grabber.options, fields[:count]


def means(fields, bits, lines):
    """The mean images of both views, without what the border or the seam cuts off."""
    threshold = choose_threshold(np.bincount(fields[0].luma.ravel(), minlength=256), ThresholdRule(), bits)
    images = []
    for field in fields:
        whole = double_lines(field) if lines == "doubled" else field
        blobs = measure(quantise(whole, bits, threshold), None, LocationSettings())
        from_seam = np.abs(blobs.xy_px[:, 0] - SEAM_PX)
        blobs = blobs.select(~blobs.at_border & (from_seam > blobs.width_px / 2))
        images.append(FieldImages(blobs.xy_px, blobs.sigma_px, field.parity, 0.08))
    return mean_images(images)


@pytest.mark.slow
@pytest.mark.parametrize("reflections", [1, 2])
@pytest.mark.parametrize(("bits", "lines"), [(1, "doubled"), (8, "field")])
def test_every_target_is_identified_and_its_mean_is_as_good_as_stated(reflections, bits, lines):
    options, fields = pictures(reflections)
    mean, truth = means(fields, bits, lines), truth_at(options, 0)
    left = mean.xy_px[:, 0] < SEAM_PX
    nominal = roughly(np.random.default_rng(reflections))
    found = identify_frame(nominal, FRAME, mean.xy_px[left], mean.xy_px[~left])
    assert found.handedness == ((1, 1) if reflections == 2 else (-1, -1))
    sides = ((found.left, left, truth.left_px), (found.right, ~left, truth.right_px))
    for side, own, true_px in sides:
        assert len(side.unmatched) == 0
        off = mean.xy_px[own] - true_px[side.target]
        assert np.abs(off).max() < 0.4
        assert np.sqrt(((off / mean.sigma_px[own]) ** 2).mean()) < 2.0
