"""Targets that stand elsewhere than the calibration frame's file has them."""

from dataclasses import replace

import numpy as np
import pytest

from core.calibration.networks import TRUE
from core.calibration.sights import FRAME
from grabberd.core.calibration.calibration_frame import LeftOver, displaced_targets, swapped_axes
from grabberd.core.geometry import project
from grabberd.core.reconstruction import ObjectModel

REFLECTION_PX = np.array([[40.0, 300.0]])


def file_with(xyz_mm: np.ndarray) -> ObjectModel:
    return replace(FRAME, xyz_mm=xyz_mm)


def found(file: ObjectModel, missing: list[int], left_px: np.ndarray | None = None, taken=False):
    """What the true places of the missing targets tell; taken: each image for its target."""
    left, right = (project(view, FRAME.xyz_mm[missing]) for view in TRUE)
    target = np.array(missing if taken else [-1] * len(missing))
    left = left if left_px is None else left_px
    return displaced_targets(
        TRUE, file, np.array(missing), LeftOver(left, target[: len(left)]), LeftOver(right, target)
    )


@pytest.mark.parametrize("off_mm", [(0.4, 0.0, 0.0), (0.0, 3.0, 0.0), (2.0, -1.0, 6.0)])
def test_a_displaced_target_is_told_by_how_much(off_mm):
    places = FRAME.xyz_mm.copy()
    places[40] -= off_mm
    (one,) = found(file_with(places), [40])
    assert one.target == 40
    assert one.shift_mm == pytest.approx(off_mm, abs=1e-6)


def test_two_that_have_each_others_depth_are_told_apart_from_two_that_moved():
    places = FRAME.xyz_mm.copy()
    places[[40, 41], 2] = places[[41, 40], 2]
    file = file_with(places)
    assert swapped_axes(*found(file, [40, 41]), file) == "z"
    places[40, 0] += 1.0
    assert swapped_axes(*found(file_with(places), [40, 41]), file_with(places)) == ""


def test_two_that_have_each_others_x_are_told_so_though_they_seem_to_have_the_rest():
    places = FRAME.xyz_mm.copy()
    places[[40, 95], 0] = places[[95, 40], 0]
    file = file_with(places)
    assert swapped_axes(*found(file, [40, 95]), file) == "x"


def test_nothing_is_said_of_a_covered_target():
    nothing = np.empty((0, 2))
    none = LeftOver(nothing, np.empty(0, np.intp))
    assert displaced_targets(TRUE, FRAME, np.array([40]), none, none) == ()


def test_bent_pins_are_not_taken_for_one_another():
    """The rays of neighbours along the base meet, too, far from either."""
    places = FRAME.xyz_mm.copy()
    places[[40, 41]] -= (0.2, 0.0, 0.0)
    both = found(file_with(places), [40, 41], taken=True)
    assert [one.target for one in both] == [40, 41]
    assert [one.distance_mm for one in both] == pytest.approx([0.2, 0.2], abs=1e-6)


def test_an_image_that_was_taken_for_a_target_is_no_other_ones():
    left, right = (project(view, FRAME.xyz_mm[[40]]) for view in TRUE)
    seen = (LeftOver(left, np.array([40])), LeftOver(right, np.array([40])))
    assert displaced_targets(TRUE, FRAME, np.array([39]), *seen) == ()


def test_a_reflection_in_one_view_meets_nothing():
    assert found(FRAME, [40], REFLECTION_PX) == ()
