"""Targets that stand elsewhere than the calibration frame's file has them."""

from dataclasses import replace

import numpy as np
import pytest

from core.calibration.networks import TRUE
from core.calibration.sights import FRAME
from grabberd.core.calibration import displaced_targets, swapped_axes
from grabberd.core.geometry import project
from grabberd.core.reconstruction import ObjectModel

REFLECTION_PX = np.array([[40.0, 300.0]])


def file_with(xyz_mm: np.ndarray) -> ObjectModel:
    return replace(FRAME, xyz_mm=xyz_mm)


def found(file: ObjectModel, missing: list[int], left_px: np.ndarray | None = None):
    """What the true places of the missing targets tell."""
    left, right = (project(view, FRAME.xyz_mm[missing]) for view in TRUE)
    return displaced_targets(TRUE, file, np.array(missing), left if left_px is None else left_px, right)


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


def test_nothing_is_said_of_a_covered_target():
    nothing = np.empty((0, 2))
    assert displaced_targets(TRUE, FRAME, np.array([40]), nothing, nothing) == ()


def test_a_reflection_in_one_view_meets_nothing():
    assert found(FRAME, [40], REFLECTION_PX) == ()
