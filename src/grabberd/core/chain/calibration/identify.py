"""Identification of the calibration frame's targets in a capture, before any adjustment."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.core.calibration import Identification, MeanImages, identify_frame, mean_images
from grabberd.core.chain.calibration.located_frame import locate
from grabberd.core.field import NumberedField
from grabberd.core.geometry import NominalRig
from grabberd.core.measurement import LocationSettings
from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import MeasurementError

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
            return self.identification.left.target, self.identification.right.target
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
    seen = located.views
    try:
        images = (mean_images(seen[0]), mean_images(seen[1]))
    except MeasurementError as refusal:
        return SeenFrame((mean_images(seen[0][:1]), mean_images(seen[1][:1])), None, refusal, moved=True)
    try:
        with located.sizes.told():
            return SeenFrame(images, identify_frame(nominal, frame, images[0].xy_px, images[1].xy_px))
    except MeasurementError as refusal:
        return SeenFrame(images, None, refusal)
