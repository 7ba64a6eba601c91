"""Which motions map a calibration frame onto itself, and which target would tell."""

from dataclasses import replace

import numpy as np
import pytest

from core.calibration.sights import FRAME, placed
from grabberd.core.calibration.calibration_frame import symmetries, targets_to_add, undecided
from grabberd.core.geometry import project
from grabberd.core.reconstruction import ObjectModel

MARGIN = 32.0


def with_depths(depth_mm) -> ObjectModel:
    return replace(FRAME, xyz_mm=np.column_stack([FRAME.xyz_mm[:, :2], depth_mm]))


def test_the_papers_frame_is_decided_by_its_depths():
    assert undecided(FRAME, MARGIN) == ()
    (nearest,) = symmetries(FRAME)
    assert (nearest.kind, nearest.matched) == ("mirror", 84)


def test_a_plane_grid_is_the_same_turned_by_half_and_mirrored_both_ways():
    found = undecided(with_depths(np.zeros(len(FRAME))), MARGIN)
    assert sorted(one.kind for one in found) == ["mirror", "mirror", "turn"]
    assert all(one.matched == len(FRAME) for one in found)
    assert abs(next(one for one in found if one.kind == "turn").turned_deg) == pytest.approx(180)


@pytest.mark.parametrize(("along", "index"), [("rows", FRAME.column), ("columns", FRAME.row)])
def test_rows_or_columns_that_are_alike_are_named(along, index):
    depth = np.array([0.0, 5.0, -3.0, 4.0, -6.0, 2.0, 6.0, -5.0, 1.0, 3.0, -1.0, -7.0])[index]
    shifts = [one for one in symmetries(with_depths(depth)) if one.kind == "shift"]
    assert shifts
    assert {one.along for one in shifts} == {along}
    assert f"its {along} are alike" in str(shifts[0])


def test_a_common_slope_of_the_depths_does_not_hide_a_shift():
    """Along the line of sight two views see a quarter of a displacement."""
    tilted = with_depths(np.where(FRAME.row % 2, 2.0, -2.0) + 1e-3 * FRAME.row)
    assert any(one.kind == "shift" and one.matched >= 72 for one in symmetries(tilted))


def test_one_further_target_decides_a_frame_that_nothing_else_does():
    plane = with_depths(np.zeros(len(FRAME)))
    (spot,) = targets_to_add(plane, MARGIN)
    assert undecided(plane.with_target(spot), MARGIN) == ()


def test_a_frame_that_is_decided_needs_no_further_target():
    assert targets_to_add(FRAME, MARGIN) == ()


def test_a_view_of_the_moved_frame_sees_its_targets_where_the_other_sees_the_frames():
    plane = with_depths(np.zeros(len(FRAME)))
    left, _ = placed(np.random.default_rng(1))
    middle = plane.xyz_mm.mean(axis=0)
    for one in symmetries(plane):
        moved = one.moved(plane.xyz_mm, middle)
        other = one.seen_from(left, middle)
        np.testing.assert_allclose(project(other, moved), project(left, plane.xyz_mm), atol=1e-6)
        assert other.handedness == (-1 if one.kind == "mirror" else 1)
