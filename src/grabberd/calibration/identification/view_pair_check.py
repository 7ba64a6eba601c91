"""Check of both views together: two identifications must belong to one rig, close to the nominal one."""

import math

import numpy as np
from numpy.typing import NDArray

from grabberd.calibration.identification.identification_settings import IdentificationSettings
from grabberd.errors import MeasurementError
from grabberd.geometry import NominalRig, View, rotation_matrix

Array = NDArray[np.float64]


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
            "check the rig's nominal geometry and that the file belongs to this calibration frame",
        )
    _check_length("base", _length(base_mm), _length(nominal_mm), settings.relative)
    for found, stated in zip((left, right), wanted, strict=True):
        _check_length(f"distance of the {found.name} view", _far(found), _far(stated), settings.relative)


def _check_length(what: str, found_mm: float, nominal_mm: float, allowed: float) -> None:
    if abs(found_mm / nominal_mm - 1) > allowed:
        raise MeasurementError(
            f"the {what} comes out as {found_mm:.0f} mm, but the nominal rig has {nominal_mm:.0f} mm",
            "check the rig's nominal geometry, the focal length too, and that the file belongs to this "
            "calibration frame: another pitch has the same effect",
        )


def axes_of(view: View) -> Array:
    """(3, 3) from the object's frame into the camera's, handedness included."""
    rotation = rotation_matrix(view.omega_rad, view.phi_rad, view.kappa_rad)
    return np.diag([view.handedness, 1.0, 1.0]) @ rotation


def _base(left: View, right: View) -> Array:
    """(3,) from the left centre to the right one, in the left camera's coordinates."""
    return axes_of(left) @ (right.center_mm - left.center_mm)


def _relative(left: View, right: View) -> Array:
    """(3, 3) from the left camera's coordinates into the right one's."""
    return axes_of(right) @ axes_of(left).T


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
