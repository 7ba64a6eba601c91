"""From where the middles of two pictures lead to, points come to the centres of the discs."""

from dataclasses import replace

import numpy as np
import pytest

from grabberd.core.geometry import Discs, NominalRig, Rig, linearise
from grabberd.core.kernel import KERNEL
from grabberd.core.reconstruction import DiscCentres, ImageNoise, ObjectModel, ViewBlobs, intersect
from grabberd.core.reconstruction.correspondence.facing import MOST_OBLIQUE_DEG

DIAMETER_MM, RADIUS_MM, PITCH_MM = 1.5, 14.5, 6.5
RIG = Rig.of_views(
    NominalRig(720, 576, (0, 360), (360, 720), 240.0, 128.0, 30.0, 8.0, 0.0086, 0.0083).views()
)
KERNELS = pytest.mark.parametrize("kernel", [None, KERNEL], ids=["numpy", "kernel"])


def wall(rows=8, columns=6, radius_mm=RADIUS_MM):
    """A liner along X, and the true normals of its discs."""
    row, column = (one.ravel() for one in np.indices((rows, columns)))
    angle = (column - (columns - 1) / 2) * PITCH_MM / radius_mm
    normal = np.column_stack([0.0 * angle, np.sin(angle), np.cos(angle)])
    xyz = radius_mm * normal + np.column_stack([(row - (rows - 1) / 2) * PITCH_MM, 0 * angle, 0 * angle - 10])
    return model_of(xyz, row, column), normal


def model_of(xyz, row, column, **more):
    ids = np.arange(5, 5 + len(xyz), dtype=np.int32)
    grid = row.astype(np.int32), column.astype(np.int32)
    return ObjectModel("wall", ids, xyz, *grid, DIAMETER_MM, 0.3, **more)


def met(model, normal, chosen=slice(None)):
    """Points of some discs, intersected from the middles of their pictures."""
    xyz = model.xyz_mm[chosen]
    image, slopes = linearise(RIG, xyz)
    image = image + Discs(normal[chosen], DIAMETER_MM).offsets_px(RIG, xyz, slopes)
    left, right = (ViewBlobs(image[:, view].T.copy(), np.full((len(xyz), 2), 0.02)) for view in (0, 1))
    return intersect(RIG, model.target[chosen], left, right, ImageNoise(0.0, 2, 2.8))


def off_mm(points, model, chosen=slice(None)):
    return np.abs(points.xyz_mm - model.xyz_mm[chosen]).max()


@KERNELS
def test_round_a_liner_the_grids_own_normals_are_enough(kernel):
    model, normal = wall()
    points = met(model, normal)
    corrected = DiscCentres(RIG, model, kernel).corrected(points, model.xyz_mm)
    assert off_mm(points, model) > 0.003
    assert off_mm(corrected, model) < 2e-4
    assert (corrected.calibration_covariance_mm2 == 0).all()


@KERNELS
def test_normals_are_those_of_the_wall_as_it_stands_not_of_the_object_file(kernel):
    model, _ = wall()
    flat, normal = wall(radius_mm=60.0)
    points = met(flat, normal)
    corrected = DiscCentres(RIG, model, kernel).corrected(points, flat.xyz_mm)
    assert off_mm(corrected, flat) < 2e-4


@KERNELS
def test_some_of_the_targets_are_enough(kernel):
    model, normal = wall()
    some = np.arange(3, 40, 4)
    corrected = DiscCentres(RIG, model, kernel).corrected(met(model, normal, some), model.xyz_mm)
    assert off_mm(corrected, model, some) < 2e-4
    assert (corrected.target == model.target[some]).all()


def stepped(**more):
    row, column = (one.ravel() for one in np.indices((6, 6)))
    z = np.where((row + column) % 2, 4.0, -4.0)
    return model_of(
        np.column_stack([(row - 2.5) * PITCH_MM, (column - 2.5) * PITCH_MM, z]), row, column, **more
    )


@KERNELS
def test_the_files_normal_is_that_of_all_discs_whatever_their_grid(kernel):
    model = stepped(normal=(0.0, 0.4, 2.0))
    normal = np.tile(np.array([0.0, 0.4, 2.0]) / np.hypot(0.4, 2.0), (36, 1))
    corrected = DiscCentres(RIG, model, kernel).corrected(met(model, normal), model.xyz_mm)
    assert off_mm(corrected, model) < 1e-5
    assert (corrected.calibration_covariance_mm2 == 0).all()


@KERNELS
def test_where_no_normal_is_known_its_effect_is_part_of_what_averaging_leaves(kernel):
    """Discs on a stepped frame lean any way that the views can see; σ says by how much that moves them."""
    model, rng = stepped(), np.random.default_rng(4)
    errors = []
    for _ in range(60):
        tilt = np.arccos(rng.uniform(np.cos(np.radians(MOST_OBLIQUE_DEG)), 1.0, 36))
        turn = rng.uniform(0, 2 * np.pi, 36)
        normal = np.column_stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)])
        corrected = DiscCentres(RIG, model, kernel).corrected(met(model, normal), model.xyz_mm)
        errors.append(corrected.xyz_mm - model.xyz_mm)
    share = corrected.calibration_covariance_mm2
    chi2 = np.einsum("kni,nij,knj->kn", errors, np.linalg.inv(share), errors).mean() / 3
    assert 0.8 < chi2 < 1.2
    assert np.abs(np.mean(errors, axis=(0, 1))).max() < 2e-4


@KERNELS
def test_a_row_alone_has_no_normal(kernel):
    model, normal = wall(rows=8, columns=1)
    corrected = DiscCentres(RIG, model, kernel).corrected(met(model, normal), model.xyz_mm)
    sigma = np.sqrt(np.trace(corrected.calibration_covariance_mm2, axis1=1, axis2=2))
    assert (sigma > 0.001).all()
    assert off_mm(corrected, model) < 3 * sigma.max()


def test_kernel_and_numpy_give_the_same():
    model, normal = wall()
    places = model.xyz_mm + np.random.default_rng(2).normal(0, 0.3, model.xyz_mm.shape)
    both = [DiscCentres(RIG, model, one).corrected(met(model, normal), places) for one in (None, KERNEL)]
    np.testing.assert_allclose(both[0].xyz_mm, both[1].xyz_mm, atol=1e-13)


def test_without_points_there_is_nothing_to_correct():
    model, normal = wall()
    none = met(model, normal).select(np.zeros(48, np.bool_))
    assert len(DiscCentres(RIG, model).corrected(none, model.xyz_mm)) == 0


def test_indices_beyond_the_targets_are_refused_by_the_kernel():
    model, normal = wall()
    centres = DiscCentres(RIG, model)
    points = met(model, normal)
    with pytest.raises(ValueError, match="do not belong together"):
        centres.corrected(replace(points, target=points.target + 1000), model.xyz_mm)
