"""Location of the calibration frame's targets in every field of a capture."""

from collections.abc import Iterable
from typing import NamedTuple

from grabberd.core.calibration import FieldImages
from grabberd.core.chain.locating import whole
from grabberd.core.chain.target_sizes import OtherSizes, px_per_mm, sized
from grabberd.core.field import NumberedField
from grabberd.core.geometry import NominalRig
from grabberd.core.measurement import LocationSettings, measure
from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import MeasurementError


class LocatedFrame(NamedTuple):
    """Blobs of a calibration frame's capture.

    Attributes:
        views: Whole blobs of every field, of the left and of the right view.
        sizes: Of the last field, for a failure to be told with the sizes found.
    """

    views: tuple[list[FieldImages], list[FieldImages]]
    sizes: OtherSizes


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
    packed = None
    for numbered in fields:
        packed = numbered.packed
        blobs = measure(packed, None, location)
        for view, half in zip(views, halves, strict=True):
            own = blobs.select(whole(blobs, *half))
            view.append(FieldImages(own.xy_px, own.sigma_px, packed.parity, own.common_px, own.area_px))
    if packed is None:
        raise MeasurementError("the capture has no field to calibrate from", "take the capture again")
    return LocatedFrame(views, OtherSizes(packed, halves, location, scale))
