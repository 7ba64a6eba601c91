from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given

from core.geometry.rigs import calibration, places
from core.reconstruction.liners import SIGMA_PX
from grabberd.core.geometry import Calibration, LocalField, Rig, project
from grabberd.core.geometry.calibration import image_model
from grabberd.core.reconstruction import ImageNoise, Points, ViewBlobs, intersect
from grabberd.core.reconstruction.points import DIAGONAL, FIRST, SECOND, inverse_symmetric

NOISE = ImageNoise(0.12, 2, 2.9)
CORNERS = np.array([[x, y, z] for x in (-50.0, 0.0, 50.0) for y in (-15.0, 15.0) for z in (-8.0, 8.0)])


def ids(count):
    return np.arange(1, count + 1, dtype=np.int32)


def pictures(rig_calibration, xyz, moved=(0.0, 0.0), sigma=SIGMA_PX):
    """The blobs of both views; `moved` shifts them, left and right, in px."""
    spread = np.tile(sigma, (len(xyz), 1))
    return [
        ViewBlobs(project(view, xyz) + shift, spread)
        for view, shift in zip(rig_calibration.views, moved, strict=True)
    ]


def solve(rig_calibration, left, right, noise=NOISE, start=None) -> Points:
    return intersect(Rig.of(rig_calibration), ids(len(left)), left, right, noise, start)


@pytest.mark.parametrize("handedness", [1, -1])
@given(xyz=places())
def test_the_pictures_of_points_give_the_points_back(handedness, xyz):
    rig = calibration(handedness)
    points = solve(rig, *pictures(rig, xyz))
    assert np.abs(points.xyz_mm - xyz).max() < 1e-6
    assert points.residual_px.max() < 1e-6


def test_a_result_carries_its_targets_and_the_pixels_it_came_from():
    left, right = pictures(calibration(), CORNERS)
    points = solve(calibration(), left, right)
    assert points.target.tolist() == list(range(1, 13))
    assert points.target.dtype == np.int32
    assert np.array_equal(points.image_px[:, 0], left.xy_px)
    assert np.array_equal(points.image_px[:, 1], right.xy_px)


def test_the_start_does_not_matter():
    left, right = pictures(calibration(), CORNERS, moved=([0.2, 0.4], [-0.3, 0.1]))
    from_rays = solve(calibration(), left, right)
    from_afar = solve(calibration(), left, right, start=CORNERS + np.array([2.0, -2.0, 5.0]))
    assert np.abs(from_rays.xyz_mm - from_afar.xyz_mm).max() < 1e-6


def test_a_parallax_across_the_lines_stays_as_residual():
    left, right = pictures(calibration(), np.zeros((1, 3)), moved=([0.0, 0.5], [0.0, -0.5]))
    residual = solve(calibration(), left, right).residual_px[0]
    assert abs(residual - np.sqrt(2 * 0.5**2 / 4)) < 0.005


def weighted_sum(rig_calibration, left, right, xyz):
    """vᵀ P v of every point, from a covariance written down element by element."""
    v = [
        blobs.xy_px - project(view, xyz)
        for view, blobs in zip(rig_calibration.views, (left, right), strict=True)
    ]
    jitter2 = NOISE.blob_jitter_px**2
    sums = []
    for index in range(len(xyz)):
        overlap = max(0.0, 1 - abs(left.xy_px[index, 1] - right.xy_px[index, 1]) / (2 * NOISE.radius_lines))
        covariance = np.diag(np.concatenate([left.sigma_px[index], right.sigma_px[index]]) ** 2)
        covariance[[0, 2], [0, 2]] += jitter2
        covariance[[0, 2], [2, 0]] += jitter2 * overlap
        misfit = np.concatenate([v[0][index], v[1][index]])
        sums.append(misfit @ np.linalg.solve(covariance, misfit))
    return np.array(sums)


def test_no_place_beside_the_solution_fits_better():
    rng = np.random.default_rng(2)
    left, right = pictures(calibration(), CORNERS, moved=rng.normal(size=(2, len(CORNERS), 2)) * 0.3)
    left = replace(left, sigma_px=left.sigma_px * rng.uniform(0.5, 2, (len(CORNERS), 2)))
    best = solve(calibration(), left, right).xyz_mm
    least = weighted_sum(calibration(), left, right, best)
    for step in np.vstack([np.eye(3), -np.eye(3)]) * 1e-3:
        assert (weighted_sum(calibration(), left, right, best + step) > least).all()


def test_errors_are_as_large_as_the_covariance_says():
    rng = np.random.default_rng(3)
    xyz = rng.uniform(-1, 1, (4000, 3)) * [50, 15, 8]
    shared = rng.normal(size=len(xyz)) * NOISE.blob_jitter_px
    left, right = pictures(calibration(b=(0.0,) * 9), xyz)
    overlap = np.maximum(1 - np.abs(left.xy_px[:, 1] - right.xy_px[:, 1]) / (2 * NOISE.radius_lines), 0)
    for blobs in (left, right):
        blobs.xy_px[:] += rng.normal(size=blobs.xy_px.shape) * SIGMA_PX
        own = rng.normal(size=len(xyz)) * NOISE.blob_jitter_px
        blobs.xy_px[:, 0] += np.sqrt(overlap) * shared + np.sqrt(1 - overlap) * own
    points = solve(calibration(b=(0.0,) * 9), left, right)
    error = (points.xyz_mm - xyz)[:, :, np.newaxis]
    chi2 = (error.swapaxes(1, 2) @ np.linalg.solve(points.covariance_mm2, error)).mean()
    assert abs(chi2 / 3 - 1) < 0.04


def test_what_both_views_share_moves_a_point_along_the_base_more_and_in_depth_less():
    left, right = pictures(calibration(), np.zeros((1, 3)))
    shared = solve(calibration(), left, right, ImageNoise(0.3, 2, 2.9)).covariance_mm2[0]
    spread = left.sigma_px.copy()
    spread[:, 0] = np.hypot(spread[:, 0], ImageNoise(0.3, 2, 2.9).blob_jitter_px)
    left, right = replace(left, sigma_px=spread), replace(right, sigma_px=spread)
    alone = solve(calibration(), left, right, ImageNoise(0.0, 2, 2.9)).covariance_mm2[0]
    assert shared[1, 1] > alone[1, 1]
    assert shared[2, 2] < alone[2, 2]


def test_without_a_covariance_the_calibration_has_no_share():
    assert not solve(calibration(), *pictures(calibration(), CORNERS)).calibration_covariance_mm2.any()


def test_the_calibrations_share_is_that_of_moving_its_parameters():
    sigma = np.tile([0.01, 0.5, 0.5, 1e-3, 1e-3, 1e-4, 0.1, 0.1, 0.1, *[1e-4] * 2, *[1e-5] * 7], 2)
    mixing = np.eye(36) + np.random.default_rng(6).normal(size=(36, 36)) * 0.1
    covariance = (root := sigma[:, np.newaxis] * mixing) @ root.T
    certain, uncertain = calibration(), calibration(covariance=covariance)
    blobs = pictures(certain, CORNERS)
    jacobian = np.array([_moved(certain, blobs, index, 0.01 * sigma[index]) for index in range(36)])
    expected = np.einsum("pna,pq,qnb->nab", jacobian, covariance, jacobian)
    share = solve(uncertain, *blobs).calibration_covariance_mm2
    assert np.allclose(share, expected, rtol=2e-3, atol=1e-3 * expected.max())


def _moved(start: Calibration, blobs, index, step):
    """(N, 3) derivative of the points by a parameter of the calibration."""
    values = [view.vector() for view in start.views]
    sides = []
    for sign in (1, -1):
        moved = [vector.copy() for vector in values]
        moved[index // 18][index % 18] += sign * step
        left, right = (view.with_vector(vector) for view, vector in zip(start.views, moved, strict=True))
        sides.append(solve(replace(start, left=left, right=right), *blobs).xyz_mm)
    return (sides[0] - sides[1]) / (2 * step)


def test_rays_that_do_not_meet_before_the_cameras_give_nan_and_disturb_no_other_point():
    left, right = pictures(calibration(), CORNERS)
    right.xy_px[0] = [-4000.0, 300.0]
    points = solve(calibration(), left, right)
    assert np.isnan(points.xyz_mm[0]).all()
    assert np.abs(points.xyz_mm[1:] - CORNERS[1:]).max() < 1e-6


def test_no_blobs_give_no_points():
    nothing = ViewBlobs(np.empty((0, 2)), np.empty((0, 2)))
    points = solve(calibration(), nothing, nothing)
    assert len(points) == 0
    assert points.covariance_mm2.shape == (0, 3, 3)


def test_the_same_blobs_give_the_same_points_bit_for_bit():
    rig = calibration(covariance=np.eye(36) * 1e-8)
    blobs = pictures(rig, CORNERS, moved=([0.1, 0.2], [-0.1, 0.3]))
    first, second = solve(rig, *blobs), solve(rig, *blobs)
    for name in ("xyz_mm", "covariance_mm2", "calibration_covariance_mm2", "residual_px"):
        assert getattr(first, name).tobytes() == getattr(second, name).tobytes()


def flat_field(sigma_px):
    grid = np.ones((41, 50, 2))
    return LocalField.through((-0.5, -0.5), 15.0, 0 * grid, sigma_px * grid)


@pytest.mark.parametrize("correlation", [(0.0, 0.0), (0.6, 0.9), (-0.7, 0.4)])
def test_what_the_local_fields_leave_is_part_of_the_calibrations_share(correlation):
    rng = np.random.default_rng(5)
    xyz = rng.uniform(-1, 1, (4000, 3)) * [50, 15, 8]
    fields = flat_field(0.02), flat_field(0.05)
    known = replace(calibration(), local_fields=fields, details=image_model(correlation))
    left, right = rng.normal(size=(2, len(xyz), 2))
    right = np.multiply(correlation, left) + np.sqrt(1.0 - np.square(correlation)) * right
    moved = [0.02 * left, 0.05 * right]
    points = solve(known, *pictures(known, xyz, moved=moved))
    error = (points.xyz_mm - xyz)[:, :, np.newaxis]
    share = points.calibration_covariance_mm2
    chi2 = (error.swapaxes(1, 2) @ np.linalg.solve(share, error)).mean()
    assert abs(chi2 / 3 - 1) < 0.04


def test_parameters_and_local_fields_share_alike():
    known = calibration(covariance=np.eye(36) * 1e-8)
    both = replace(known, local_fields=(flat_field(0.02), None))
    only = replace(both, covariance=np.zeros((36, 36)))
    shares = [solve(one, *pictures(one, CORNERS)).calibration_covariance_mm2 for one in (known, only, both)]
    assert np.allclose(shares[0] + shares[1], shares[2], rtol=1e-9)


def test_inverses_are_those_of_the_full_matrices():
    rng = np.random.default_rng(1)
    root = rng.normal(size=(20, 3, 4))
    full = root @ root.transpose(0, 2, 1)
    six = full[:, FIRST, SECOND].T
    np.testing.assert_allclose(inverse_symmetric(six).transpose(2, 0, 1), np.linalg.inv(full), rtol=1e-9)


def test_the_diagonal_is_where_it_is_said_to_be():
    assert [(FIRST[index], SECOND[index]) for index in DIAGONAL] == [(0, 0), (1, 1), (2, 2)]
