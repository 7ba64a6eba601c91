"""Whether the rig has moved, from points of a liner whose true rig is another than the calibration's."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from core.geometry.rigs import calibration
from core.reconstruction.liners import model, see, wall
from grabberd.core.geometry import Rig, rotation_angles, rotation_matrix
from grabberd.core.reconstruction import Correspondence, CorrespondenceSettings, ImageNoise
from grabberd.core.reconstruction.drift_check import (
    WINDOW,
    DriftCheck,
    RigVerdict,
    parallax,
    parallax_of_calibration,
)

PX_RAD = 0.0084 / 8.0
ACROSS, ALONG, ROLL = range(3)


def turned(known, view, axis, px):
    """The calibration with one view turned about its axis, so that its images move by so many pixels."""
    one = getattr(known, view)
    turn = np.zeros(3)
    turn[axis] = px * PX_RAD
    rotation = rotation_matrix(*turn) @ rotation_matrix(one.omega_rad, one.phi_rad, one.kappa_rad)
    angles = dict(zip(("omega_rad", "phi_rad", "kappa_rad"), rotation_angles(rotation), strict=True))
    return replace(known, **{view: replace(one, **angles)})


@cache
def fitted(view="left", axis=ACROSS, px=0.0, seed=0, false=0.05, fields=10):
    known, rng = calibration(), np.random.default_rng(seed)
    rig = Rig.of(known)
    noise = ImageNoise.of(rig, model(), 0.0, 2)
    generous = Correspondence(rig, model(), noise, CorrespondenceSettings(unmodelled_px=1.0))
    movement, true = DriftCheck(rig, model()), Rig.of(turned(known, view, axis, px))
    for field in range(fields):
        scene = see(*wall(2.5 + 2.5 * np.sin(field)), rng, rig=true, noise=1.0, false=false)
        movement.add(generous.identify(scene.left, scene.right).points)
    return movement.fit()


@pytest.mark.parametrize("seed", range(6))
def test_a_rig_that_has_not_moved_fits(seed):
    fit = fitted(seed=seed)
    assert fit.verdict is RigVerdict.FITS
    assert fit.shift_px < 0.12
    assert fit.ratio < 2


@pytest.mark.parametrize("view", ["left", "right"])
@pytest.mark.parametrize("px", [0.3, 1.0, 3.0])
def test_a_mirror_that_moves_images_across_the_epipolar_lines_is_seen_with_its_size(view, px):
    fit = fitted(view, ACROSS, px)
    assert fit.verdict is RigVerdict.MOVED
    assert fit.shift_px == pytest.approx(px, rel=0.06, abs=0.04)


def test_a_movement_along_the_epipolar_lines_looks_like_points_at_another_place():
    assert fitted("left", ALONG, 1.0).verdict is RigVerdict.FITS


def test_as_many_false_points_as_one_in_four_change_little():
    assert fitted("left", ACROSS, 1.0, false=0.25).shift_px == pytest.approx(1.0, abs=0.08)
    assert fitted(false=0.25).verdict is RigVerdict.FITS


def test_without_enough_fields_or_targets_nothing_is_claimed():
    fit = fitted(fields=3)
    assert fit.verdict is RigVerdict.UNKNOWN
    assert np.isnan(fit.ratio)


def test_what_was_seen_is_forgotten_when_the_object_is_gone():
    rig = Rig.of(calibration())
    movement, rng = DriftCheck(rig, model()), np.random.default_rng(1)
    identify = Correspondence(rig, model(), ImageNoise.of(rig, model(), 0.0, 2)).identify
    points = identify(*_blobs(see(*wall(0.0), rng, noise=1.0))).points
    for _ in range(WINDOW):
        movement.add(points)
    assert movement.fit().verdict is RigVerdict.FITS
    for _ in range(WINDOW):
        movement.add(points.none())
    assert movement.fit().verdict is RigVerdict.UNKNOWN


def test_a_doubtful_calibration_excuses_what_it_does_not_know():
    covariance = np.zeros((36, 36))
    covariance[2, 2] = 0.3**2
    known = calibration(covariance=covariance)
    rig, true = Rig.of(known), Rig.of(replace(known, left=replace(known.left, y0_px=known.left.y0_px + 0.4)))
    movement, rng = DriftCheck(rig, model()), np.random.default_rng(2)
    noise = ImageNoise.of(rig, model(), 0.0, 2)
    identify = Correspondence(rig, model(), noise, CorrespondenceSettings(unmodelled_px=1.0)).identify
    for _ in range(8):
        movement.add(identify(*_blobs(see(*wall(0.0), rng, rig=true, noise=1.0))).points)
    fit = movement.fit()
    assert fit.shift_px > 0.3
    assert fit.ratio < 2
    assert fit.verdict is RigVerdict.FITS


def test_a_parallax_is_the_difference_of_the_lines_and_no_matter_of_the_place():
    rig = Rig.of(calibration())
    identify = Correspondence(rig, model(), ImageNoise.of(rig, model(), 0.0, 2)).identify
    points = identify(*_blobs(see(*wall(0.0), np.random.default_rng(3), noise=1.0))).points
    before, _ = parallax(rig, points)
    image = points.image_px.copy()
    image[:, 0, 1] += 0.5
    image[:, 1, 1] -= 0.5
    lower, _ = parallax(rig, replace(points, image_px=image))
    elsewhere, _ = parallax(rig, replace(points, xyz_mm=points.xyz_mm + 0.1))
    assert lower - before == pytest.approx(1.0)
    assert elsewhere == pytest.approx(before, abs=1e-3)


def test_a_calibration_whose_covariance_is_not_known_adds_nothing():
    assert parallax_of_calibration(Rig.of(calibration()), model().xyz_mm).shape == (108, 0)


def _blobs(scene):
    return scene.left, scene.right
