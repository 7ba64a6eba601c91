"""Settings of a calibration, and its result with everything it rests on."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from grabberd.calibration import (
    Adjustment,
    Blunder,
    Difference,
    Elimination,
    Identification,
    LocalFieldTrial,
    MeanImages,
    Normality,
    Validation,
    VolumeSigma,
)
from grabberd.geometry import PARAMETERS, Calibration, NominalRig, View
from grabberd.measurement import LocationSettings
from grabberd.reconstruction import ObjectModel


@dataclass(frozen=True, slots=True)
class CalibrateSettings:
    """Settings of a calibration.

    Attributes:
        equal_weights: all image coordinates weigh the same, as in the paper; otherwise by their own σ.
        held: the calibration frame's points are held; otherwise weighted by its σ.
        free: names of the parameters to be adjusted, as `Unknowns.of` takes them.
        shared: names of the parameters that are one and the same in both views, such as `LENS`.
        tied: b9 = b8.
        alpha: of the significance tests; None: every parameter stays.
        local_field: whether local fields are tried.
        handedness: of both views; None: found.
        location: how blobs are located.
    """

    equal_weights: bool = False
    held: bool = False
    free: tuple[str, ...] = PARAMETERS
    shared: tuple[str, ...] = ()
    tied: bool = False
    alpha: float | None = 0.05
    local_field: bool = True
    handedness: int | None = None
    location: LocationSettings = field(default_factory=LocationSettings)


@dataclass(frozen=True, slots=True, eq=False)
class CalibrateResult:
    """A calibration with everything that it rests on.

    Attributes:
        frame: the calibration frame; `settings`: how it was made; `nominal`: the rig as built.
        bits: of the fields; `y_step`: of their rows.
        images: mean images of each view, left then right; `identification`: which target each is.
        adjustment: of the functional model; `elimination`: how its parameters were chosen, None where none
            were tested.
        blunders: image points left out.
        unmodelled_px: what every image point's σ was enlarged by so that σ0 is 1.
        local: the trial of local fields, None where it was not asked for; where they were accepted, the views
            are those that it ends with.
        differences, normality, volume: what is known of the result.
        validation: of the model without local fields; None where too few targets are left to hold some out.
        pointing_px: σ of one field's image coordinates in x and y, which `volume` is for.
        warnings: what a person should know, in sentences.
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
    differences: tuple[Difference, ...]
    normality: tuple[Normality, ...]
    validation: Validation | None
    volume: VolumeSigma
    pointing_px: tuple[float, float]
    warnings: tuple[str, ...]

    @property
    def final(self) -> Adjustment:
        """The adjustment that the calibration's views and covariance are from."""
        return self.local.adjustment if self.local else self.adjustment

    @property
    def views(self) -> tuple[View, ...]:
        """The views as calibrated."""
        return self.final.views

    def calibration(
        self,
        name: str,
        created_utc: str,
        source: str,
        glass: Mapping[str, float] | None,
        details: Mapping[str, Any],
    ) -> Calibration:
        """The calibration itself, under a name."""
        trial = self.local
        left, right = self.views
        return Calibration(
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
            local_fields=(trial.fields[0], trial.fields[1]) if trial else (None, None),
            details=details,
        )
