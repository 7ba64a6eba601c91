"""One capture of the calibration frame: its blobs, their means, and the targets they are of, before any
adjustment.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.calibration import (
    FieldImages,
    Identification,
    IdentificationSettings,
    Mark,
    MeanImages,
    Network,
    identify_by_hand,
    identify_frame,
    mean_images,
)
from grabberd.core.chain.calibration.calibration_result import CalibrateSettings
from grabberd.core.chain.locating import OtherSizes, px_per_mm, sized, whole
from grabberd.core.chain.repeats import RepeatJudge
from grabberd.core.field import NumberedField, unpack
from grabberd.core.geometry import NominalRig, View
from grabberd.core.measurement import LocationSettings, measure
from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import MeasurementError


class LocatedFrame(NamedTuple):
    """Blobs of a calibration frame's capture.

    Attributes:
        views: Whole blobs of every field, of the left and of the right view.
        sizes: Of the last field, for a failure to be told with the sizes found.
        repeated: Number of fields that repeat another: they are left out, since they add nothing to a mean.
    """

    views: tuple[list[FieldImages], list[FieldImages]]
    sizes: OtherSizes
    repeated: int

    @property
    def images(self) -> tuple[MeanImages, MeanImages]:
        """Mean images of the left and of the right view.

        Raises:
            MeasurementError: The calibration frame moved, or the field order is wrong.
        """
        left, right = self.views
        return mean_images(left), mean_images(right)


def locate(
    fields: Iterable[NumberedField], nominal: NominalRig, frame: ObjectModel, location: LocationSettings
) -> LocatedFrame:
    """Locate whole blobs of the size that the frame's targets have with the nominal rig, unless it is set.

    Raises:
        MeasurementError: There are no fields.
    """
    views: tuple[list[FieldImages], list[FieldImages]] = ([], [])
    scale, halves = px_per_mm(nominal), (nominal.left, nominal.right)
    location = sized(location, scale, frame.target_diameter_mm)
    packed, judge, repeated = None, RepeatJudge(of_any_parity=True), 0
    for numbered in fields:
        packed = numbered.packed
        if judge.take(unpack(packed)):
            repeated += 1
            continue
        blobs = measure(packed, None, location)
        for view, half in zip(views, halves, strict=True):
            own = blobs.select(whole(blobs, *half))
            view.append(FieldImages(own.xy_px, own.sigma_px, packed.parity, own.common_px, own.area_px))
    if packed is None:
        raise MeasurementError("the capture has no field to calibrate from", "take the capture again")
    return LocatedFrame(views, OtherSizes(packed, halves, location, scale), repeated)


Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class FrameCapture:
    """A capture of the calibration frame, identified.

    Attributes:
        seen: Whole blobs of every field, of the left and of the right view.
        bits: Bits per pixel of the fields.
        y_step: Frame lines from row to row.
        images: Mean images of each view, left then right.
        identification: Their targets.
        network: The identified images of both views, to be adjusted.
        repeated: Number of fields that repeat another, and are left out.
    """

    seen: tuple[list[FieldImages], list[FieldImages]]
    bits: int
    y_step: int
    images: tuple[MeanImages, MeanImages]
    identification: Identification
    network: Network
    repeated: int

    @classmethod
    def of(
        cls,
        fields: Iterable[NumberedField],
        nominal: NominalRig,
        frame: ObjectModel,
        settings: CalibrateSettings,
        by_hand: Sequence[Mark] | None = None,
    ) -> "FrameCapture":
        """Locate, average and identify.

        Raises:
            MeasurementError: No fields, a calibration frame that moves, too few targets, or an unclear
                identification; the message says which.
        """
        located = locate(fields, nominal, frame, settings.location)
        images, packed = located.images, located.sizes.packed
        with located.sizes.told():
            identification = _identify(nominal, frame, images, settings, by_hand)
        network = network_of(images, identification, frame, settings)
        return cls(
            located.views, packed.bits, packed.y_step, images, identification, network, located.repeated
        )

    @property
    def pointing_px(self) -> tuple[float, float]:
        """Standard deviation of one field's image coordinates in x and y, the common part included."""
        variance = [np.nan_to_num(side.scatter_px) ** 2 + side.sigma_px**2 for side in self.images]
        x, y = np.sqrt(np.concatenate(variance).mean(axis=0)).tolist()
        return x, y

    @property
    def view_sigma_px(self) -> tuple[float, float]:
        """Median pointing σ of one field in each view."""
        left, right = (float(np.median(np.concatenate([one.sigma_px for one in side]))) for side in self.seen)
        return left, right

    def disc_share(self, views: Sequence[View], frame: ObjectModel) -> tuple[float, float]:
        """Median area of the targets in each view, over that of a disc's geometric image."""
        left, right = (
            float(np.median(np.concatenate([one.area_px for one in side if one.area_px is not None])))
            / _disc_area_px(view, frame)
            for side, view in zip(self.seen, views, strict=True)
        )
        return left, right


def _identify(
    nominal: NominalRig,
    frame: ObjectModel,
    images: tuple[MeanImages, MeanImages],
    settings: CalibrateSettings,
    by_hand: Sequence[Mark] | None,
) -> Identification:
    believed = IdentificationSettings(handedness=(settings.handedness, settings.handedness))
    left, right = (side.xy_px for side in images)
    if by_hand is None:
        return identify_frame(nominal, frame, left, right, believed)
    return identify_by_hand(nominal, frame, left, right, by_hand, believed)


def network_of(
    images: tuple[MeanImages, MeanImages],
    identification: Identification,
    frame: ObjectModel,
    settings: CalibrateSettings,
) -> Network:
    """The identified images of both views as a network to adjust."""
    targets = [side.target for side in identification]
    known = [target >= 0 for target in targets]
    sigma = np.concatenate([side.sigma_px[own] for side, own in zip(images, known, strict=True)])
    if settings.equal_weights:
        sigma = np.full_like(sigma, np.sqrt(np.mean(sigma**2)))
    place_sigma = 0.0 if settings.held else frame.sigma_mm
    return Network(
        views=identification.views,
        view=np.repeat([0, 1], [int(own.sum()) for own in known]),
        target=np.concatenate([target[own] for target, own in zip(targets, known, strict=True)]),
        xy_px=np.concatenate([side.xy_px[own] for side, own in zip(images, known, strict=True)]),
        sigma_px=sigma,
        target_mm=frame.xyz_mm,
        target_sigma_mm=np.full_like(frame.xyz_mm, place_sigma),
        ids=frame.target,
    )


def _disc_area_px(view: View, frame: ObjectModel) -> float:
    away_mm = float(np.linalg.norm(view.center_mm - frame.xyz_mm.mean(axis=0)))
    diameter_mm = frame.target_diameter_mm * view.f_mm / away_mm
    return float(np.pi / 4 * diameter_mm**2 / (view.pixel_x_mm * view.pixel_y_mm))


Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class SeenFrame:
    """A calibration frame as identified in a capture.

    Attributes:
        images: mean images of the left and of the right view, including blobs that are no targets.
        identification: target of each image; None if it is ambiguous.
        refusal: reason why there is no identification, or None.
        moved: True if the calibration frame moves; the images are then those of the first field.
    """

    images: tuple[MeanImages, MeanImages]
    identification: Identification | None
    refusal: MeasurementError | None = None
    moved: bool = False

    @property
    def target(self) -> tuple[Indices, Indices]:
        """(B,) for each view: index of each image's target in the calibration frame, −1 if it has none."""
        if self.identification is not None:
            left, right = (side.target for side in self.identification)
        else:
            left, right = (np.full(len(side), -1, np.intp) for side in self.images)
        return left, right


def identify(
    fields: Iterable[NumberedField],
    nominal: NominalRig,
    frame: ObjectModel,
    location: LocationSettings | None = None,
) -> SeenFrame:
    """Finds the targets of a calibration frame; if it moves or is ambiguous, returns images and the reason.

    Args:
        fields: any number, of both parities.
        nominal: the rig as built, each number to within ten per cent.
        frame: the calibration frame's targets.
        location: settings for locating blobs.

    Raises:
        MeasurementError: there are no fields.
    """
    located = locate(fields, nominal, frame, location or LocationSettings())
    try:
        images = located.images
    except MeasurementError as refusal:
        left, right = (mean_images(view[:1]) for view in located.views)
        return SeenFrame((left, right), None, refusal, moved=True)
    try:
        with located.sizes.told():
            return SeenFrame(images, identify_frame(nominal, frame, images[0].xy_px, images[1].xy_px))
    except MeasurementError as refusal:
        return SeenFrame(images, None, refusal)
