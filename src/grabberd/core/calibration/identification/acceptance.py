"""Acceptance of an identification: its criteria, and the check that both views belong to one rig, close to
the nominal one.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.core.geometry import NominalRig, View
from grabberd.errors import MeasurementError

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class IdentificationSettings:
    """Criteria for accepting an identification.

    Attributes:
        handedness: Of the left and the right view, +1 or −1; None finds it from the picture.
        least_targets: Least number of identified targets that determines a view.
        least_share: Share of a view's blobs that the winner must explain.
        sigma_px: Total standard deviation of an image coordinate, including errors of the rough model.
        most_rms_px: Greatest RMS of the identified targets' residuals; more indicates another calibration
            frame.
        margin: Least difference of −2 ln(likelihood) between runner-up and winner.
        relative: Greatest relative deviation of base and distance from nominal.
        relative_deg: Greatest deviation of the views' relative orientation from nominal.
    """

    handedness: tuple[int | None, int | None] = (None, None)
    least_targets: int = 12
    least_share: float = 0.8
    sigma_px: float = 0.5
    most_rms_px: float = 0.5
    margin: float = 60.0
    relative: float = 0.3
    relative_deg: float = 20.0


def check_pair(left: View, right: View, nominal: NominalRig, settings: IdentificationSettings) -> None:
    """Check that the views are oriented relative to one another and to the calibration frame as nominal.

    Raises:
        MeasurementError: The views are rotated against one another, or base or distance differ; the message
            has the values.
    """
    wanted = nominal.views((left.handedness, right.handedness))
    base_mm, nominal_mm = _base(left, right), _base(*wanted)
    turned_deg = max(
        _angle_deg(base_mm, nominal_mm), _turn_deg(_relative(left, right) @ _relative(*wanted).T)
    )
    if turned_deg > settings.relative_deg:
        raise MeasurementError(
            f"the views are rotated against one another by {turned_deg:.0f} degrees from the nominal rig; "
            f"up to {settings.relative_deg:g} are allowed",
            handedness_hint((left.handedness, right.handedness), nominal.handedness)
            or "check the rig's nominal geometry and that the file belongs to this calibration frame",
        )
    _check_length("base", _length(base_mm), _length(nominal_mm), settings.relative)
    for found, stated in zip((left, right), wanted, strict=True):
        _check_length(f"distance of the {found.name} view", _far(found), _far(stated), settings.relative)


def handedness_hint(found: Sequence[int], stated: Sequence[int | None]) -> str | None:
    """Hint for pictures that fit no rig, where the handedness betrays mirrored halves; None where not."""
    names = ("left", "right")
    wrong = [name for name, one, built in zip(names, found, stated, strict=True) if one == -1 and built != -1]
    if len(wrong) == 2:
        return (
            "both views are seen mirrored: switch off the mirroring of camera or grabber; only an odd number "
            "of mirrors before each view explains it, state it as handedness: -1 then"
        )
    if wrong:
        return (
            f"the {wrong[0]} view is seen mirrored and the other is not: one half of the picture is "
            "mirrored, or its path has another number of mirrors than is configured"
        )
    return None


def _check_length(what: str, found_mm: float, nominal_mm: float, allowed: float) -> None:
    if abs(found_mm / nominal_mm - 1) > allowed:
        raise MeasurementError(
            f"the {what} comes out as {found_mm:.0f} mm, but the nominal rig has {nominal_mm:.0f} mm",
            "check the rig's nominal geometry, the focal length too, and that the file belongs to this "
            "calibration frame: another pitch has the same effect",
        )


def _base(left: View, right: View) -> Array:
    """(3,) from the left centre to the right one, in the left camera's coordinates."""
    return left.axes @ (right.center_mm - left.center_mm)


def _relative(left: View, right: View) -> Array:
    """(3, 3) from the left camera's coordinates into the right one's."""
    return right.axes @ left.axes.T


def _far(view: View) -> float:
    """Distance of the object's origin."""
    return _length(view.center_mm)


def _length(vector: Array) -> float:
    return float(np.linalg.norm(vector))


def _turn_deg(rotation: Array) -> float:
    return math.degrees(math.acos(max(-1.0, min(1.0, (float(np.trace(rotation)) - 1) / 2))))


def _angle_deg(first: Array, second: Array) -> float:
    cosine = float(first @ second) / (_length(first) * _length(second))
    return math.degrees(math.acos(max(-1.0, min(1.0, cosine))))
