"""Static liners of leaning discs behind uneven mirrors: single fields and their mean beside the truth."""

from functools import cache
from typing import NamedTuple

import cv2
import numpy as np
from tests.core.chain.leaning_scene import Discs, LeaningScene, Mirrors
from tests.core.chain.pinhole_pictures import Optics
from tests.core.shipped_models import PAPER, shipped_model

from grabberd.core.chain.accuracy import requantised
from grabberd.core.chain.calibration.calibrate import calibrate
from grabberd.core.chain.measure import MeasureSetup, measure_fields
from grabberd.core.geometry import NominalRig, Rig
from grabberd.core.measurement import LocationSettings
from grabberd.core.reconstruction import ImageNoise, ObjectModel, ViewBlobs, intersect
from grabberd.core.reconstruction.accuracy import WRONG_BEYOND_MM

NOMINAL = NominalRig(720, 576, (0, 360), (360, 720), 240.0, 128.0, 30.0, 8.0, 0.0086, 0.0083)
DOWN, ACROSS = 0, 1
"""The liner's axis in the picture."""
RADIUS_MM, PITCH_MM, MOST_OBLIQUE_DEG = 14.5, 6.5, 66.0
NEAR_PX = 3.0
HALF_LENGTHS = (8.5, 3.5)
"""Rows either side of the middle, so that the liner fits into the picture either way."""


class Averaged(NamedTuple):
    """Single fields and the mean of all: RMS in the picture (x, y) and in space, what is stated, χ² by
    coordinate; how many points were not found, and how many of them are another target's.
    """

    missed: int
    wrong: int
    pointing_px: np.ndarray
    single_mm: float
    single_chi2: float
    mean_mm: float
    stated_mm: float
    chi2: float


@cache
def calibrated(seed, uneven_px, fields=64, dim=0.55, optics=None, poses=1, bits=8, doubled=False):
    """A calibration from pictures of the calibration frame, and the mirrors it was made behind."""
    frame, mirrors = shipped_model(PAPER), Mirrors(seed, uneven_px, dim, optics or Optics())
    rng = np.random.default_rng((seed, 9))
    discs = Discs.facing(frame.xyz_mm + rng.normal(0, frame.sigma_mm, frame.xyz_mm.shape))
    posed = [discs, *(discs.moved(*_pose(rng)) for _ in range(poses - 1))]
    captures = [LeaningScene(one, mirrors).fields(fields, seed + 1000 + k) for k, one in enumerate(posed)]
    if bits < 8:
        captures = [requantised(one, bits, doubled=doubled) for one in captures]
    made = calibrate(captures, NOMINAL, frame)
    return made.calibration("averaging", "2026-01-01T00:00:00+00:00", "averaging", None, {}), mirrors


def _pose(rng):
    """A turn by up to eight degrees about each axis, and a shift by up to 3 mm."""
    turn, _ = cv2.Rodrigues(np.deg2rad(rng.uniform(-8, 8, 3)))
    return turn, rng.uniform(-3, 3, 3)


def liner(axis, seed, optics=None):
    """Discs round a liner along an axis, each a little off its place; those that both views see well."""
    angle = np.deg2rad(25.6) * np.arange(-2.5, 3)
    along = PITCH_MM * np.arange(-HALF_LENGTHS[axis], HALF_LENGTHS[axis] + 0.5)
    along, angle = (each.ravel() for each in np.meshgrid(along, angle, indexing="ij"))
    xyz = np.zeros((len(along), 3))
    xyz[:, axis] = along + np.random.default_rng(seed).uniform(-0.2, 0.2, len(along))
    xyz[:, 1 - axis], xyz[:, 2] = RADIUS_MM * np.sin(angle), RADIUS_MM * np.cos(angle) - 10.0
    discs = Discs.round_a_liner(xyz, axis, RADIUS_MM)
    cameras = Mirrors(seed, optics=optics or Optics()).cameras
    sights = np.array([camera.center - xyz for camera in cameras])
    facing = (sights * discs.normal).sum(axis=2) / np.linalg.norm(sights, axis=2)
    seen = (facing > np.cos(np.deg2rad(MOST_OBLIQUE_DEG))).all(axis=0)
    return Discs(xyz[seen], discs.normal[seen])


def averaged(known, mirrors, axis, seed, **how):
    """Measure some fields of a liner, and compare with its truth."""
    return averaged_discs(known, mirrors, liner(axis, seed, mirrors.optics), seed, **how)


def averaged_discs(known, mirrors, discs, seed, fields=32, bits=8, doubled=False, **location):
    """Measure so many fields of discs at rest, and compare with their truth."""
    setup = MeasureSetup(known, object_model(discs.xyz_mm), location=LocationSettings(**location))
    scene, pointing = LeaningScene(discs, mirrors), []
    shape = fields, len(discs.xyz_mm)
    error, own, common = (np.full((*shape, *rest), np.nan) for rest in ((3,), (3, 3), (3, 3)))
    pictures = scene.fields(fields, seed + 500)
    # Fields of 8 bits keep the threshold of the scene, which was chosen for the dimmest of its discs.
    pictures = pictures if bits == 8 else requantised(pictures, bits, doubled=doubled)
    for n, one in enumerate(measure_fields(pictures, setup)):
        pointing.append(_off_px(one.blobs, scene.true_px))
        which = one.points.target - 1
        error[n, which] = one.points.xyz_mm - discs.xyz_mm[which]
        own[n, which] = one.points.covariance_mm2
        common[n, which] = one.points.calibration_covariance_mm2
    seen = np.isfinite(error).all(axis=2)
    times = seen.sum(axis=0)[:, np.newaxis]
    mean = np.nansum(error, axis=0) / times
    stated = np.nanmean(own, axis=0) / times[..., np.newaxis] + np.nanmean(common, axis=0)
    return Averaged(
        int((~seen).sum()),
        int((np.linalg.norm(error[seen], axis=1) > WRONG_BEYOND_MM).sum()),
        np.sqrt((np.concatenate(pointing) ** 2).mean(axis=0)),
        rms_mm(error[seen]),
        chi2(error[seen], (own + common)[seen]),
        rms_mm(mean),
        stated_mm(stated),
        chi2(mean, stated),
    )


def _off_px(blobs, true_px):
    """(N, 2) errors of the blobs that are the nearest to where a target truly appears, in either view."""
    places = true_px.reshape(-1, 2)
    off = blobs.xy_px[:, np.newaxis] - places
    nearest = np.hypot(*off.transpose(2, 0, 1)).argmin(axis=0)
    off = off[nearest, np.arange(len(places))]
    return off[(np.hypot(*off.T) < NEAR_PX) & ~blobs.at_border[nearest]]


def at_exact_places(known, mirrors):
    """Points over the volume from the true places of their images: errors (N, 3) and the calibration's
    covariances.
    """
    axes = np.linspace(-45, 45, 7), np.linspace(-20, 20, 6), np.linspace(-7, 7, 3)
    xyz = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    blobs = []
    for view, camera in enumerate(mirrors.cameras):
        there = camera.project(xyz)
        there = there + mirrors.displaced(view, there)
        local = known.local_fields[view]
        place = there if local is None else there - local.at(there)
        blobs.append(ViewBlobs(place, np.full_like(place, 0.02), np.full(len(place), 0.04), 4.0))
    target = np.arange(len(xyz), dtype=np.int32)
    points = intersect(Rig.of(known), target, *blobs, ImageNoise(0.12, 2, 2.8))
    return points.xyz_mm - xyz, points.calibration_covariance_mm2


def rms_mm(error):
    """Root mean square distance of errors (…, 3)."""
    return float(np.sqrt((error**2).sum(axis=-1).mean()))


def stated_mm(covariance):
    """The same from covariances (…, 3, 3)."""
    return float(np.sqrt(np.trace(covariance, axis1=-2, axis2=-1).mean()))


def chi2(error, covariance):
    """Mean of the squared errors in units of their covariance, by coordinate."""
    return float(np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance), error).mean()) / 3


def object_model(xyz):
    half_pitches = np.rint((xyz - xyz.min(axis=0)) / PITCH_MM * 2).astype(int)
    targets = [
        {"id": k + 1, "x_mm": x, "y_mm": y, "z_mm": z, "row": int(row), "column": int(column)}
        for k, ((x, y, z), (row, column, _)) in enumerate(zip(xyz.tolist(), half_pitches, strict=True))
    ]
    return ObjectModel.from_document(
        {"name": "leaning", "target_diameter_mm": 1.5, "sigma_mm": 0.3, "targets": targets}
    )
