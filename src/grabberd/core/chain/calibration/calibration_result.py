"""Settings of a calibration, and its result with all intermediate results."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from grabberd.core.arrays import Array, Indices
from grabberd.core.calibration.adjustment.adjustment import Adjustment
from grabberd.core.calibration.adjustment.frame_poses import FramePose
from grabberd.core.calibration.identification.frame_identification import Identification
from grabberd.core.calibration.local_field_trial import LocalFieldTrial
from grabberd.core.calibration.mean_images import MeanImages, Stillness
from grabberd.core.calibration.residuals import Blunder, Normality
from grabberd.core.calibration.significance import Difference, Elimination, Validation
from grabberd.core.calibration.validity import VolumeSigma
from grabberd.core.geometry import PARAMETERS, Calibration, LocalField, NominalRig, Rig, View, project_all
from grabberd.core.geometry.calibration import image_model
from grabberd.core.measurement import LocationSettings
from grabberd.core.measurement.marks import MarkReference
from grabberd.core.reconstruction import ImageNoise, ObjectModel, ViewBlobs, intersect
from grabberd.errors import InputError, MeasurementError

_PROBE_PX = 0.1
"""σ of the images with which a new calibration is tried."""
_PROBE_MM = 1e-3
"""Distance within which an image leads back to its place: far more than rounding, far less than σ."""


@dataclass(frozen=True, slots=True)
class CalibrateSettings:
    """Settings of a calibration.

    Attributes:
        equal_weights: weight all image coordinates equally, as in the paper; otherwise by their own σ.
        held: hold the calibration frame's points fixed; otherwise weight them by its σ.
        free: names of the parameters to adjust, in the form of `Unknowns.of`.
        shared: names of the parameters that both views share, such as `LENS`.
        tied: force b9 = b8.
        alpha: significance level of the parameter tests; None: keep every parameter.
        local_field: True to try local fields.
        handedness: handedness of both views, as their mirrors make it; None: as the rig states, or else as
            the picture shows it.
        turn_deg: turn of the calibration frame in the picture, by a person who has looked; None: nobody has.
        location: settings for locating blobs.
    """

    equal_weights: bool = False
    held: bool = False
    free: tuple[str, ...] = PARAMETERS
    shared: tuple[str, ...] = ()
    tied: bool = False
    alpha: float | None = 0.05
    local_field: bool = True
    handedness: int | None = None
    turn_deg: float | None = None
    location: LocationSettings = field(default_factory=LocationSettings)


@dataclass(frozen=True, slots=True, eq=False)
class CalibrateResult:
    """A calibration with all intermediate results.

    Attributes:
        frame: the calibration frame.
        nominal: the rig as built.
        settings: settings of the calibration.
        bits: bits per pixel of the fields; `y_step`: frame lines from row to row.
        images: mean images of each view, left then right; `identification`: their targets.
        adjustment: adjustment of the functional model.
        elimination: significance tests that chose its parameters; None if none were tested.
        blunders: image points left out.
        unmodelled_px: σ added to every image point so that σ0 is 1.
        local: trial of local fields, None if not requested; if accepted, the final views are its views.
        final: adjustment of which the calibration has its views and their covariance, dropped parameters
            included.
        differences: comparison of the two views' parameters.
        normality: tests of the residuals for normality.
        volume: expected σ over the volume, for one field's `pointing_px`.
        validation: cross-validation of the model without local fields; None with too few targets for it.
        pointing_px: σ of one field's image coordinates in x and y.
        unvalidated: why there is no cross-validation; empty if there is one.
        stillness: movement of the picture during the capture, left then right.
        repeated: number of fields that repeat another, and are left out.
        merging: indices of the targets whose discs each view shows running into another; they are left out.
        disc_share: median area of a target in each view, over that of its geometric image.
        view_sigma_px: median pointing σ of one field in each view.
        poses: poses of the calibration frame after the first, in the frame of the first.
        marks: the marks as seen in the first pose's capture; None if there are none.
    """

    frame: ObjectModel
    nominal: NominalRig
    settings: CalibrateSettings
    bits: int
    y_step: int
    images: tuple[MeanImages, MeanImages]
    identification: Identification
    adjustment: Adjustment
    elimination: Elimination | None
    blunders: tuple[Blunder, ...]
    unmodelled_px: float
    local: LocalFieldTrial | None
    final: Adjustment
    differences: tuple[Difference, ...]
    normality: tuple[Normality, ...]
    validation: Validation | None
    volume: VolumeSigma
    pointing_px: tuple[float, float]
    unvalidated: str
    stillness: tuple[Stillness, Stillness]
    repeated: int
    merging: tuple[Indices, Indices]
    disc_share: tuple[float, float]
    view_sigma_px: tuple[float, float]
    poses: tuple[FramePose, ...] = ()
    marks: MarkReference | None = None

    @property
    def views(self) -> tuple[View, ...]:
        """The views as calibrated."""
        return self.final.views

    @property
    def image_points(self) -> int:
        """Number of image points of all poses."""
        return len(self.adjustment.network) + sum(pose.count for pose in self.poses)

    @property
    def local_fields(self) -> tuple[LocalField | None, LocalField | None]:
        """Local field of each view, learned or only of a known size; None if the model leaves nothing."""
        if self.local and self.local.accepted:
            return self.local.fields[0], self.local.fields[1]
        if not self.unmodelled_px:
            return None, None
        left, right = (
            LocalField.unknown(*half, self.nominal.lines, self.unmodelled_px)
            for half in (self.nominal.left, self.nominal.right)
        )
        return left, right

    def calibration(
        self,
        name: str,
        created_utc: str,
        source: str,
        glass: Mapping[str, float] | None,
        details: Mapping[str, Any],
    ) -> Calibration:
        """The calibration itself, under a name.

        Raises:
            MeasurementError: it cannot be read back from its document, or not be used.
        """
        left, right = self.views
        calibration = Calibration(
            id=name,
            created_utc=created_utc,
            source=source,
            columns=self.nominal.columns,
            lines=self.nominal.lines,
            left=left,
            right=right,
            covariance=self.final.parameter_covariance,
            sigma0_px=self.adjustment.sigma0_px,
            glass=glass,
            local_fields=self.local_fields,
            details={**details, **image_model(self.local.both.correlation if self.local else (0.0, 0.0))},
        )
        return read_back(calibration, self.frame.xyz_mm)


def read_back(calibration: Calibration, places_mm: Array) -> Calibration:
    """A calibration read from its own document, as every later reader gets it, and used once.

    Args:
        calibration: the calibration.
        places_mm: (N, 3) targets of the calibration frame, whose images must lead back to them.

    Raises:
        MeasurementError: it cannot be read, or does not lead back.
    """
    hint = "this is a bug of the adjustment: report it, with the capture of the calibration frame"
    try:
        read = Calibration.from_document(json.loads(json.dumps(calibration.to_document())))
    except InputError as error:
        raise MeasurementError(f"the calibration cannot be read back: {error.message}", hint) from error
    rig = Rig.of(read)
    left, right = (
        ViewBlobs(image.T, np.full((len(places_mm), 2), _PROBE_PX))
        for image in project_all(rig, places_mm).swapaxes(0, 1)
    )
    noise = ImageNoise(_PROBE_PX, 1, 1.0)
    found = intersect(rig, np.arange(len(places_mm), dtype=np.int32), left, right, noise)
    off_mm = np.abs(found.xyz_mm - places_mm)
    if not (off_mm < _PROBE_MM).all() or not np.isfinite(found.calibration_covariance_mm2).all():
        raise MeasurementError(
            f"images of the calibration frame lead {np.nanmax(off_mm):.2g} mm past its targets", hint
        )
    return read
