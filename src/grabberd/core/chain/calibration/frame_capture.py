"""One capture of the calibration frame: its blobs, their means, and the targets they are of, before any
adjustment.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.calibration.adjustment.network import DiscNetwork, Network
from grabberd.core.calibration.identification.frame_identification import (
    Identification,
    IdentificationSettings,
    ViewIdentification,
    identify_frame,
)
from grabberd.core.calibration.identification.manual_identification import Mark, identify_by_hand
from grabberd.core.calibration.mean_images import FieldImages, MeanImages, mean_images
from grabberd.core.chain.calibration.calibration_result import CalibrateSettings
from grabberd.core.chain.locating import OtherSizes, px_per_mm, sized, whole
from grabberd.core.chain.repeats import RepeatJudge
from grabberd.core.field import NumberedField, unpack
from grabberd.core.geometry import Discs, NominalRig, View, project
from grabberd.core.measurement import LocationSettings, measure
from grabberd.core.measurement.marks import Located, MarkReference
from grabberd.core.reconstruction import ObjectModel
from grabberd.core.reconstruction.object_model import FACING
from grabberd.errors import InputError, MeasurementError


class LocatedFrame(NamedTuple):
    """Blobs of a calibration frame's capture.

    Attributes:
        views: Whole blobs of every field, of the left and of the right view.
        sizes: Of the last field, for a failure to be told with the sizes found.
        repeated: Number of fields that repeat another: they are left out, since they add nothing to a mean.
        marks: Parity of each field, and its located marks, where there are any.
    """

    views: tuple[list[FieldImages], list[FieldImages]]
    sizes: OtherSizes
    repeated: int
    marks: list[tuple[int, Located]]

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
    marks: list[tuple[int, Located]] = []
    for numbered in fields:
        packed = numbered.packed
        if judge.take(unpack(packed)):
            repeated += 1
            continue
        if packed.marks is not None:
            marks.append((packed.parity, packed.marks))
        blobs = measure(packed, None, location)
        for view, half in zip(views, halves, strict=True):
            own = blobs.select(whole(blobs, *half))
            images = own.xy_px, own.sigma_px, packed.parity, own.common_px, own.area_px
            view.append(FieldImages(*images, packed.is_doubled))
    if packed is None:
        raise MeasurementError("the capture has no field to calibrate from", "take the capture again")
    return LocatedFrame(views, OtherSizes(packed, halves, location, scale), repeated, marks)


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
        merging: Indices of the targets that each view shows too near to another to tell the two apart; they
            are left out of it.
        repeated: Number of fields that repeat another, and are left out.
        marks: The marks as learnt from it; None if there are none.
    """

    seen: tuple[list[FieldImages], list[FieldImages]]
    bits: int
    y_step: int
    images: tuple[MeanImages, MeanImages]
    identification: Identification
    network: Network
    merging: tuple[Indices, Indices]
    repeated: int
    marks: MarkReference | None = None

    @classmethod
    def of(
        cls,
        fields: Iterable[NumberedField],
        nominal: NominalRig,
        frame: ObjectModel,
        settings: CalibrateSettings,
        marked: Sequence[Mark] = (),
    ) -> "FrameCapture":
        """Locate, average and identify.

        Raises:
            MeasurementError: No fields, a calibration frame that moves, too few targets, or an unclear
                identification; the message says which.
        """
        located = locate(fields, nominal, frame, settings.location)
        images, packed = located.images, located.sizes.packed
        with located.sizes.told():
            known = known_of(nominal, settings.handedness, settings.turn_deg)
            sides = zip(images, located.views, strict=True)
            joined_px = [mean.xy_px[_sizes(mean, fields) > _JOINED] for mean, fields in sides]
            try:
                identification = _identify(nominal, frame, images, known, marked)
            except MeasurementError as error:
                raise _overlapping(error, joined_px, nominal, frame) from error
        left, right = identification
        merging = _merging(left, joined_px[0], frame), _merging(right, joined_px[1], frame)
        network = network_of(images, identification, frame, settings)
        for index, targets in enumerate(merging):
            apart = (network.view != index) | ~np.isin(network.target, targets)
            network = network.select(apart)
        about = packed.bits, packed.y_step, images, identification, network, merging, located.repeated
        return cls(located.views, *about, MarkReference.learnt(located.marks))

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
    known: IdentificationSettings,
    marked: Sequence[Mark],
) -> Identification:
    left, right = (side.xy_px for side in images)
    if not marked:
        return identify_frame(nominal, frame, left, right, known)
    return identify_by_hand(nominal, frame, left, right, marked, known)


def known_of(
    nominal: NominalRig, handedness: int | None = None, turn_deg: float | None = None
) -> IdentificationSettings:
    """Collect what is known of a picture of the calibration frame.

    Args:
        nominal: The rig, which may state the handedness of its views.
        handedness: Of both views, where the rig does not state it.
        turn_deg: See `IdentificationSettings`.

    Raises:
        InputError: The rig states another handedness.
    """
    stated = [handedness if built is None else built for built in nominal.handedness]
    if handedness is not None and stated != [handedness, handedness]:
        raise InputError(
            f"handedness {handedness:+d} is given, but the rig's configuration states "
            f"{' and '.join(f'{one:+d}' for one in stated)} for the left and right view",
            "leave it out: the rig's configuration counts the mirrors, and a mirrored picture adds none",
        )
    return IdentificationSettings(handedness=(stated[0], stated[1]), turn_deg=turn_deg)


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
    return DiscNetwork(
        views=identification.views,
        view=np.repeat([0, 1], [int(own.sum()) for own in known]),
        target=np.concatenate([target[own] for target, own in zip(targets, known, strict=True)]),
        xy_px=np.concatenate([side.xy_px[own] for side, own in zip(images, known, strict=True)]),
        sigma_px=sigma,
        target_mm=frame.xyz_mm,
        target_sigma_mm=np.full_like(frame.xyz_mm, place_sigma),
        ids=frame.target,
        discs=Discs.parallel(len(frame), frame.target_diameter_mm, frame.normal or FACING),
    )


_SPREAD_PX = 3.0
"""Distance between the edges of two discs' images below which blur joins them, or pulls on their centres."""


_JOINED = 1.4
"""Size of a blob, over their median, from which it is two discs in one: a disc alone is up to 1.3 of it."""
_SIZED_BY = 4
"""Fields that the sizes are taken from."""


def _sizes(images: MeanImages, fields: Sequence[FieldImages]) -> Array:
    """(B,) areas of blobs over their median, by the first fields; 1 where no field knows them."""
    if not len(images):  # a dark view
        return np.ones(0)
    areas = [
        one.area_px[np.linalg.norm(images.xy_px[:, np.newaxis] - one.xy_px, axis=2).argmin(axis=1)]
        for one in fields[:_SIZED_BY]
        if one.area_px is not None and len(one.area_px)
    ]
    mean: Array = np.mean(areas or [np.ones(len(images))], axis=0)
    return mean / np.median(mean)


def _near(view: View, frame: ObjectModel, others_px: Array) -> Mask:
    """(T, N) True where a place of others (N, 2) is so near to a target's disc that the two would join."""
    reach_px = math.sqrt(4 / math.pi * _disc_area_px(view, frame)) + _SPREAD_PX
    seen_px = project(view, frame.xyz_mm)
    return np.asarray(np.linalg.norm(seen_px[:, np.newaxis] - others_px, axis=2) < reach_px)


def _next_to(view: View, frame: ObjectModel) -> Mask:
    """(T, T) True for targets whose discs the file lets run into each other."""
    return _near(view, frame, project(view, frame.xyz_mm)) & ~np.eye(len(frame), dtype=bool)


def _merging(side: ViewIdentification, joined_px: Array, frame: ObjectModel) -> Indices:
    """Indices of the targets whose discs a view shows running into another: a blob for each, too near to the
    other's, or one blob of the size of two. A wrong file brings together what the picture shows apart.
    """
    next_to = _next_to(side.view, frame)
    seen = np.isin(np.arange(len(frame)), side.target)
    apart = (next_to & seen).any(axis=1) & seen
    joined = next_to.any(axis=1) & _near(side.view, frame, joined_px).any(axis=1)
    return np.flatnonzero(apart | joined)


_MANY, _SOME = 0.1, 0.03
"""Share of the targets that would run into each other, and of the blobs that are as large as two discs, from
which this is the likeliest reason of a failure.
"""


def _overlapping(
    error: MeasurementError, joined_px: Sequence[Array], nominal: NominalRig, frame: ObjectModel
) -> MeasurementError:
    """The error, or a likelier reason: discs that run into each other, by the picture and the nominal rig."""
    for view, joined in zip(nominal.views(), joined_px, strict=True):
        count = int(_next_to(view, frame).any(axis=1).sum())
        if count > _MANY * len(frame) and len(joined) > _SOME * len(frame):
            return MeasurementError(
                f"discs overlap: {len(joined)} blobs of the {view.name} view are as large as two, and as the "
                f"rig is configured, {count} of {len(frame)} targets run into each other there; "
                f"{error.message}",
                "turn the calibration frame until both views show its discs apart, or use one with smaller "
                "steps in depth",
            )
    return error


def _disc_area_px(view: View, frame: ObjectModel) -> float:
    away_mm = float(np.linalg.norm(view.center_mm - frame.xyz_mm.mean(axis=0)))
    diameter_mm = frame.target_diameter_mm * view.f_mm / away_mm
    return float(np.pi / 4 * diameter_mm**2 / (view.pixel_x_mm * view.pixel_y_mm))


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
    refusal: MeasurementError | InputError | None = None
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
    *,
    turn_deg: float | None = None,
    marked: Sequence[Mark] = (),
) -> SeenFrame:
    """Finds the targets of a calibration frame; if it moves or is ambiguous, returns images and the reason.

    Args:
        fields: any number, of both parities.
        nominal: the rig as built, each number to within ten per cent.
        frame: the calibration frame's targets.
        location: settings for locating blobs.
        turn_deg: turn of the calibration frame in the picture, by a person who has looked; None: nobody has.
        marked: targets marked by hand.

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
            return SeenFrame(
                images, _identify(nominal, frame, images, known_of(nominal, None, turn_deg), marked)
            )
    except (MeasurementError, InputError) as refusal:
        return SeenFrame(images, None, refusal)
