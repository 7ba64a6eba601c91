"""A check of the calibration: fields of the calibration frame against its certificate."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from grabberd.core.arrays import Array, Indices
from grabberd.core.calibration.identification.frame_identification import (
    Identification,
    IdentificationSettings,
    identify_frame,
)
from grabberd.core.calibration.mean_images import MeanImages
from grabberd.core.chain.calibration.frame_capture import locate
from grabberd.core.field import NumberedField
from grabberd.core.geometry import Calibration, NominalRig, Rig, project_all
from grabberd.core.measurement import LocationSettings
from grabberd.core.reconstruction import DiscCentres, ImageNoise, ObjectModel, Points, ViewBlobs, intersect
from grabberd.core.reconstruction.accuracy import Axes, RigidMotion, rigid_motion
from grabberd.core.reconstruction.drift_check import parallax
from grabberd.core.reconstruction.object_model import FACING
from grabberd.errors import MeasurementError

UNMODELLED_PX = 0.06
"""σ that uneven mirrors add to a mean image beyond any model."""
LEAST_TARGETS = 12
ENOUGH_SEEN = 0.6
DOUBTFUL_CHI2, DOUBTFUL_MM = 3.0, 0.05
BAD_CHI2, BAD_MM = 9.0, 0.1
"""Both have to be exceeded: χ² alone flags harmless errors, millimetres alone a poor frame. The paper allows
.2 mm for a length."""
DOUBTFUL_PX, BAD_PX = 0.25, 0.5
"""Limits of the parallax, which is .1 px on a rig that has not moved."""


class CheckVerdict(StrEnum):
    """Verdict on whether the calibration still holds."""

    FITS = "fits"
    DOUBTFUL = "doubtful"
    RECALIBRATE = "recalibrate"


@dataclass(frozen=True, slots=True, eq=False)
class Check:
    """The calibration frame measured with a calibration.

    Attributes:
        verdict: overall verdict; `reasons`: sentences that explain it, empty if the calibration fits.
        fields: number of fields measured.
        seen: number of targets found in both views; `of`: number of targets on the calibration frame.
        rmse: errors of the points against the certificate, after a rigid fit unless the frame is in place.
        chi2: mean squared error in units of σ; 1 if the calibration is as good as its covariance claims.
        placed: rigid motion of the points onto the certificate: the calibration frame's pose now relative to
            its pose during calibration.
        as_placed: errors without that motion.
        shift_px: (2, 2) mean of observed minus expected images: view, (x, y); `residual_px`: their root mean
            square.
        parallax_px: root mean square disagreement of the two views across the epipolar lines.
    """

    verdict: CheckVerdict
    reasons: tuple[str, ...]
    fields: int
    seen: int
    of: int
    rmse: Axes
    chi2: float
    placed: RigidMotion
    as_placed: Axes
    shift_px: Array
    residual_px: Array
    parallax_px: float


def check(
    fields: Iterable[NumberedField],
    nominal: NominalRig,
    frame: ObjectModel,
    calibration: Calibration,
    location: LocationSettings | None = None,
    *,
    in_place: bool = False,
    turn_deg: float | None = None,
) -> Check:
    """Measures the calibration frame, which stands still, and compares it with its certificate.

    Targets are identified with the nominal rig, so that even a badly outdated calibration can be checked.

    Args:
        fields: any number, of both parities.
        nominal: the rig as built.
        frame: the calibration frame's targets.
        calibration: the calibration to check.
        location: settings for locating blobs.
        in_place: True if the calibration frame stands exactly where it stood during calibration; otherwise
            one rigid motion is free, and a camera that has moved as a whole goes undetected.
        turn_deg: turn of the calibration frame in the picture, where it looks the same in several ways: that
            of the calibration will do, since what looks the same also stands in the same places.

    Raises:
        MeasurementError: there are no fields, the calibration frame moves or cannot be identified, or too few
            targets are seen.
    """
    located = locate(fields, nominal, frame, location or LocationSettings())
    images = located.images
    with located.sizes.told():
        left, right = calibration.views
        known = IdentificationSettings((left.handedness, right.handedness), turn_deg=turn_deg)
        identified = identify_frame(nominal, frame, images[0].xy_px, images[1].xy_px, known)
    points = _points(images, identified, calibration, frame)
    return _compared(points, frame, Rig.of(calibration), images[0].of_fields, in_place=in_place)


def _points(
    images: tuple[MeanImages, MeanImages],
    identified: Identification,
    calibration: Calibration,
    frame: ObjectModel,
) -> Points:
    """Points of the targets seen in both views; `target` is their index in the calibration frame."""
    targets = [side.target for side in identified]
    both = np.intersect1d(targets[0][targets[0] >= 0], targets[1][targets[1] >= 0])
    if len(both) < LEAST_TARGETS:
        raise MeasurementError(
            f"{len(both)} of {len(frame)} targets of the calibration frame are seen in both views",
            "put the calibration frame where both views see it whole, and clean mirrors and glass",
        )
    left, right = (
        _view_blobs(side, _places(target, both), calibration, view)
        for view, (side, target) in enumerate(zip(images, targets, strict=True))
    )
    rig = Rig.of(calibration)
    met = intersect(rig, both.astype(np.int32), left, right, ImageNoise.of(rig, frame, 0.0, 1))
    met = met.select(np.flatnonzero(np.isfinite(met.xyz_mm).all(axis=1)))
    if not calibration.disc_centres:
        return met
    # The frame may stand turned from where it stood, and its discs face elsewhere with it.
    turn = rigid_motion(met.xyz_mm, frame.xyz_mm[met.target]).rotation
    x, y, z = (np.array(frame.normal or FACING) @ turn).tolist()
    number = np.arange(len(frame), dtype=np.int32)
    centres = DiscCentres(rig, replace(frame, target=number, normal=(x, y, z)))
    return centres.corrected(met, frame.xyz_mm)


def _places(target: Indices, wanted: Indices) -> Indices:
    order = np.argsort(target, kind="stable")
    return order[np.searchsorted(target[order], wanted)]


def _view_blobs(images: MeanImages, chosen: Indices, calibration: Calibration, view: int) -> ViewBlobs:
    xy_px, local_field = images.xy_px[chosen], calibration.local_fields[view]
    corrected = xy_px if local_field is None else xy_px - local_field.at(xy_px)
    return ViewBlobs(corrected, np.hypot(images.sigma_px[chosen], UNMODELLED_PX))


def _compared(points: Points, frame: ObjectModel, rig: Rig, fields: int, *, in_place: bool) -> Check:
    true = frame.xyz_mm[points.target]
    placed = rigid_motion(points.xyz_mm, true)
    straight = points.xyz_mm - true
    fitted = straight if in_place else placed.apply(points.xyz_mm) - true
    covariance = points.covariance_mm2 + points.calibration_covariance_mm2
    covariance = (covariance if in_place else placed.turn(covariance)) + frame.sigma_mm**2 * np.eye(3)
    # The rigid fit takes six degrees of freedom from the errors that it minimises.
    freedom = 3 * len(true) - (0 if in_place else 6)
    chi2 = float((fitted * np.linalg.solve(covariance, fitted[:, :, np.newaxis])[:, :, 0]).sum() / freedom)
    expected_mm = true if in_place else (true - placed.shift_mm) @ placed.rotation
    off = points.image_px - project_all(rig, expected_mm).transpose(2, 1, 0)
    rmse = Axes.of((fitted**2).mean(axis=0))
    parallax_px = float(np.sqrt((parallax(rig, points)[0] ** 2).mean()))
    verdict, reasons = _judged(rmse, chi2, parallax_px, len(true), len(frame))
    return Check(
        verdict=verdict,
        reasons=reasons,
        fields=fields,
        seen=len(true),
        of=len(frame),
        rmse=rmse,
        chi2=chi2,
        placed=placed,
        as_placed=Axes.of((straight**2).mean(axis=0)),
        shift_px=off.mean(axis=0),
        residual_px=np.sqrt((off**2).mean(axis=0)),
        parallax_px=parallax_px,
    )


def _judged(
    rmse: Axes, chi2: float, parallax_px: float, seen: int, of: int
) -> tuple[CheckVerdict, tuple[str, ...]]:
    off = chi2 > DOUBTFUL_CHI2 and rmse.xyz_mm > DOUBTFUL_MM
    bad = (chi2 > BAD_CHI2 and rmse.xyz_mm > BAD_MM) or parallax_px > BAD_PX
    apart, few = parallax_px > DOUBTFUL_PX, seen < ENOUGH_SEEN * of
    findings = {
        f"the targets are {rmse.xyz_mm:.3f} mm off, {np.sqrt(chi2):.1f} times what is to be expected": off,
        f"the views lie {parallax_px:.2f} px apart across the epipolar lines": apart,
        f"only {seen} of {of} targets are seen in both views": few,
    }
    reasons = tuple(text for text, holds in findings.items() if holds)
    if bad:
        return CheckVerdict.RECALIBRATE, reasons
    return (CheckVerdict.DOUBTFUL if reasons else CheckVerdict.FITS), reasons
