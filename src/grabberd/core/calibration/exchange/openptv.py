"""Orientations, distortion, targets and calibration points in OpenPTV's files.

OpenPTV adds its distortion to the ideal point, as it is here by default, but about the middle of the sensor
and not about the principal point (xh, yh); an affinity follows. Where these are not zero a view is right to
first order in the distortion: enough to start an adjustment from, not to measure with. Pixels have their
origin at the corner of the picture there. Refraction at water and glass is not part of a view.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.core.calibration.exchange.lines import Lines
from grabberd.core.geometry import View
from grabberd.core.geometry.conversions import axes_from_openptv, pixels_from_corner, pixels_from_sensor
from grabberd.errors import InputError

Array = NDArray[np.float64]

_TARGET_COLUMNS = 8
_ORTHOGONAL = 1e-4
_HINT = "check that the file is an orientation that OpenPTV has written (NAME.ori)"


@dataclass(frozen=True, slots=True)
class Sensor:
    """Picture of OpenPTV's control parameters.

    Attributes:
        columns: Picture width in pixels.
        lines: Picture height.
        pixel_mm: Pixel pitch in x and y.
    """

    columns: int
    lines: int
    pixel_mm: tuple[float, float]


def read_orientation(name: str, text: str, added: str, sensor: Sensor) -> View:
    """Read a view from an orientation file and the file of added parameters.

    Args:
        name: Name of the view.
        text: Content of NAME.ori: centre and angles, rotation matrix, xh, yh and principal distance in mm.
        added: Content of NAME.addpar: k1, k2, k3, p1, p2, scale in x, shear; empty for none.
        sensor: The picture.

    Raises:
        InputError: A file is not of this kind, or its matrix is no rotation.
    """
    words = text.split()
    values = Lines(text, f"orientation {name}").as_numbers(words, 18)
    rotation = np.array(values[6:15]).reshape(3, 3)
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > _ORTHOGONAL or np.linalg.det(rotation) < 0:
        raise InputError(f"the matrix of orientation {name} is no rotation", _HINT)
    left, _, right = np.linalg.svd(rotation)
    xh, yh, distance = values[15:18]
    if distance <= 0:
        raise InputError(f"the principal distance of orientation {name} is {distance}", _HINT)
    principal = pixels_from_sensor(np.array([[xh, yh]]), sensor.columns, sensor.lines, sensor.pixel_mm)[0]
    x, y, z = values[:3]
    plain = View(
        name=name,
        first_column=0,
        end_column=sensor.columns,
        pixel_x_mm=sensor.pixel_mm[0],
        pixel_y_mm=sensor.pixel_mm[1],
        handedness=1,
        f_mm=distance,
        x0_px=float(principal[0]),
        y0_px=float(principal[1]),
        omega_rad=0.0,
        phi_rad=0.0,
        kappa_rad=0.0,
        X0_mm=x,
        Y0_mm=y,
        Z0_mm=z,
        b=_distortion(added, name),
    )
    return plain.with_axes(axes_from_openptv(left @ right))


def read_targets(text: str) -> tuple[NDArray[np.int32], Array]:
    """Read the image points of a file NAME_targets.

    Returns:
        (N,) numbers of the calibration points they were assigned to, negative if to none, and (N, 2) frame
        pixels.

    Raises:
        InputError: The text is no such file.
    """
    lines = Lines(text, "the file of targets")
    count = int(lines.numbers(1)[0])
    rows = np.array([values[:_TARGET_COLUMNS] for values in lines.block(_TARGET_COLUMNS)])
    if len(rows) != count:
        raise InputError(
            f"the file of targets holds {len(rows)} lines and states {count}", "check that it is complete"
        )
    rows = rows.reshape(-1, _TARGET_COLUMNS)
    return rows[:, 7].astype(np.int32), pixels_from_corner(rows[:, 1:3])


def read_calibration_points(text: str) -> tuple[NDArray[np.int32], Array]:
    """Read the known points of a calibration body: ids (N,) and positions (N, 3) in mm.

    Raises:
        InputError: A line is something else; the message says which.
    """
    lines = Lines(text, "the file of calibration points")
    rows = np.array([lines.as_numbers(line.split(), 4)[:4] for line in lines.rest()]).reshape(-1, 4)
    return rows[:, 0].astype(np.int32), rows[:, 1:]


def matched(
    projected_px: Array, observed_px: Array, gate_px: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Pair known points with the image points nearest to where they are expected.

    Args:
        projected_px: (K, 2) expected positions of the known points.
        observed_px: (N, 2) image points.
        gate_px: Greatest distance.

    Returns:
        Indices of known points and of their image points; only pairs that are each other's nearest.
    """
    if not len(projected_px) or not len(observed_px):
        return np.empty(0, np.intp), np.empty(0, np.intp)
    apart = np.linalg.norm(projected_px[:, np.newaxis] - observed_px, axis=2)
    apart = np.where(np.isnan(apart), np.inf, apart)
    nearest = apart.argmin(axis=1)
    known = np.arange(len(projected_px))
    mutual = (apart.argmin(axis=0)[nearest] == known) & (apart[known, nearest] <= gate_px)
    return known[mutual], nearest[mutual]


def _distortion(added: str, name: str) -> tuple[float, ...]:
    """b1…b9 of the added parameters, to first order in shear and scale."""
    if not added.strip():
        return (0.0,) * 9
    values: Sequence[float] = Lines(added, f"added parameters {name}").as_numbers(added.split(), 7)
    k1, k2, k3, p1, p2, scale, shear = values[:7]
    # x' = scale (x − shear y): half of the scale as b1, the rest is f; half of the shear as b2, the rest κ.
    return (-0.5 * (scale - 1.0), -0.5 * shear, k1, k2, k3, p1, p2, 0.0, 0.0)
