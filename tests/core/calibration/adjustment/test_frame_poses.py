"""Networks of one rig before which the calibration frame stands in several poses."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from core.calibration.networks import TRUE, frame, network, tied
from core.geometry.rigs import views as any_view
from grabberd.core.calibration.adjustment.adjustment import adjust
from grabberd.core.calibration.adjustment.frame_poses import (
    PosedUnknowns,
    frame_poses,
    from_pose,
    joined,
    of_first_pose,
    pose_between,
)
from grabberd.core.calibration.adjustment.network import Unknowns
from grabberd.core.calibration.significance import cross_validate
from grabberd.core.geometry import project, rotation_matrix
from grabberd.errors import MeasurementError

POSES = np.array([[0.15, -0.1, 0.3, 4.0, -3.0, 3.0], [-0.12, 0.14, -2.8, -3.0, 4.0, -4.0]])
PLACES = frame(8, 6)
ANGLE, SHIFT = st.floats(-0.6, 0.6), st.floats(-10, 10)
ANY_POSE = st.tuples(ANGLE, ANGLE, st.floats(-3, 3), SHIFT, SHIFT, SHIFT).map(np.array)


def seen(pose, seed, sigma_mm=0.0, rig=TRUE):
    """What a rig shows of the frame in a pose, as a network in the frame's own coordinates."""
    views = tuple(from_pose(view, pose) for view in rig)
    return network(views, PLACES, target_sigma_mm=sigma_mm, seed=seed)


def three(seed, sigma_mm=0.0):
    """The frame in three poses; its targets' stated places err alike in all of them."""
    parts = [seen(pose, 10 * seed + number, sigma_mm) for number, pose in enumerate([np.zeros(6), *POSES])]
    stated = parts[0].target_mm
    return joined([replace(one, target_mm=stated) for one in parts])


def posed(rig=TRUE, poses=3):
    return PosedUnknowns.of_rig(tied(rig), poses)


@given(any_view(), ANY_POSE)
def test_a_view_of_the_frame_in_a_pose_is_the_rigs_view_of_the_moved_frame(view, pose):
    moved = PLACES @ rotation_matrix(*pose[:3]).T + pose[3:]
    there = project(view, moved)
    here = project(from_pose(view, pose), PLACES)
    assert np.allclose(there, here, rtol=0, atol=1e-8, equal_nan=True)


@given(ANY_POSE)
def test_the_pose_is_found_again_from_the_views(pose):
    assert np.allclose(pose_between(TRUE, [from_pose(view, pose) for view in TRUE]), pose, atol=1e-9)


@settings(max_examples=12)
@given(ANY_POSE, st.sampled_from([1, -1]))
def test_derivatives_are_those_of_finite_differences(pose, handedness):
    rig = tuple(replace(view, handedness=handedness) for view in TRUE)
    unknowns = posed(rig, 2)
    views = (*rig, *(replace(from_pose(view, pose), name=view.name + " (2)") for view in rig))
    analytic, values = unknowns.derivatives(views), unknowns.values(views)
    assert np.allclose(values[-6:], pose, atol=1e-9)
    for index in range(len(unknowns)):
        step = np.zeros(len(unknowns))
        step[index] = 1e-6
        above, below = (
            np.concatenate([view.vector() for view in unknowns.with_values(views, values + sign * step)])
            for sign in (1, -1)
        )
        assert np.allclose((above - below) / 2e-6, analytic[:, index], atol=2e-5), unknowns.names[index]


def test_pictures_without_error_give_rig_and_poses():
    adjusted = adjust(three_exact(), posed())
    assert adjusted.sigma0 < 1e-3
    assert np.allclose(adjusted.values[-12:], POSES.ravel(), atol=1e-6)
    assert np.allclose(adjusted.values[:-12], tied().values(TRUE), rtol=1e-4, atol=1e-8)


def three_exact():
    parts = [
        network(tuple(from_pose(view, pose) for view in TRUE), PLACES, seed=None)
        for pose in [np.zeros(6), *POSES]
    ]
    return joined(parts)


@pytest.mark.parametrize("sigma_mm", [0.0, 0.02])
def test_the_covariance_is_that_of_repeated_adjustments(sigma_mm):
    total, squares, repeats = 0.0, 0.0, 30
    truth = np.concatenate([tied().values(TRUE), POSES.ravel()])
    for seed in range(repeats):
        adjusted = adjust(three(seed, sigma_mm), posed())
        off = adjusted.values - truth
        total += off @ np.linalg.solve(adjusted.covariance / adjusted.sigma0**2, off)
        squares += adjusted.sum_of_squares
    freedom = repeats * len(truth)
    assert chi2.ppf(1e-4, freedom) < total < chi2.ppf(1 - 1e-4, freedom)
    assert squares == pytest.approx(repeats * adjusted.freedom, rel=0.05)


def test_three_poses_determine_a_rig_better_than_one_of_three_times_the_weight():
    several = of_first_pose(adjust(three(1, 0.01), posed()))
    alone = seen(np.zeros(6), 1, 0.01)
    single = adjust(replace(alone, sigma_px=alone.sigma_px / 3**0.5), tied())
    ratio = (several.sigma / several.sigma0) / (single.sigma / single.sigma0)
    assert np.median(ratio) < 0.75
    assert len(several.views) == 2
    assert len(several.unknowns) == 34


def test_a_pose_says_how_well_it_agrees():
    poses = frame_poses(adjust(three(1), posed()))
    assert [one.count for one in poses] == [96, 96]
    assert [one.turn_deg for one in poses] == pytest.approx([19.9, 159.6], abs=1.5)
    for one, true in zip(poses, POSES, strict=True):
        assert one.tau == pytest.approx(1.0, abs=0.2)
        assert (np.abs(one.values - true) < 4.5 * one.sigma).all()
    assert frame_poses(adjust(seen(np.zeros(6), 1), Unknowns.of(TRUE, tied=True))) == ()


def test_held_out_targets_are_predicted_as_well_as_stated():
    held = cross_validate(three(2, 0.01), posed(), blocks=4)
    assert 0.6 < held.chi2 / held.freedom < 1.5


def test_a_rig_of_another_handedness_is_refused():
    other = seen(POSES[0], 1, rig=tuple(replace(view, handedness=-1) for view in TRUE))
    with pytest.raises(MeasurementError, match="capture 2 shows the calibration frame mirrored"):
        joined([seen(np.zeros(6), 1), other])
