"""Bundle projects exported by PhotoModeler as text, as DBAT reads them, and DBAT's control points.

A line per image with its pose and camera, then control points, object points, and image points in pixels.
Lengths are in m there and in mm here; pixels keep their origin, so principal points are in that of the file.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.core.calibration.adjustment.network import Network
from grabberd.core.calibration.exchange.lines import Lines
from grabberd.core.geometry import View
from grabberd.core.geometry.conversions import axes_from_omega_phi_kappa
from grabberd.core.geometry.view import Polynomial
from grabberd.errors import InputError

Array = NDArray[np.float64]

_MM = 1000.0
_SEPARATOR = ","


@dataclass(frozen=True, slots=True)
class ControlPoint:
    """A point of known position.

    Attributes:
        xyz_mm: Position.
        sigma_mm: Standard deviation of each coordinate, 0 if held.
    """

    xyz_mm: tuple[float, float, float]
    sigma_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)


def read_control_points(text: str) -> dict[int, ControlPoint]:
    """Read control points as DBAT keeps them: id, name, X, Y, Z in m, and none, one, two or three σ.

    Raises:
        InputError: A line is something else; the message says which.
    """
    lines, points = Lines(text, "the list of control points"), {}
    for line in lines.rest():
        words = [word.strip() for word in line.split(_SEPARATOR)]
        number, *values = lines.as_numbers([words[0], *words[2:]], 4)
        x, y, z = (_MM * value for value in values[:3])
        given = [_MM * value for value in values[3:]]
        sigma = {0: (0.0,) * 3, 1: (*given,) * 3, 2: (*given[:1], *given), 3: tuple(given)}.get(len(given))
        if sigma is None:
            raise InputError(
                f"control point {words[0]} has {len(given)} values after its position",
                "give none (held), one, two (XY and Z) or three standard deviations",
            )
        points[int(number)] = ControlPoint((x, y, z), (sigma[0], sigma[1], sigma[2]))
    return points


def read_photomodeler(
    text: str,
    control: Mapping[int, ControlPoint],
    *,
    f_mm: float | None = None,
    polynomial: Polynomial = "correction",
) -> Network:
    """Read a bundle project as a network; everything but control points and image points is a starting value.

    Views start without distortion, with square pixels and the principal point in the middle.

    Args:
        text: The export.
        control: Control points by id, which replace those of the file.
        f_mm: Rough focal length; None for that of the file.
        polynomial: Meaning of the views' polynomial; PhotoModeler's is a correction.

    Raises:
        InputError: The text is no such export, or a control point is not among its object points.
    """
    lines = Lines(text, "the bundle project")
    lines.next()
    _, _, columns, image_lines = lines.numbers(4)[:4]
    sigma_px = lines.numbers(2)[1]
    camera = lines.numbers(5)
    lines.next()
    pitch_mm = camera[4] / image_lines
    views = []
    while line := lines.next():
        name = line.split(maxsplit=1)[-1].replace("\\", "/").rpartition("/")[2].rpartition(".")[0]
        outer = lines.numbers(7)[1:]
        for _ in range(4):
            lines.next()
        views.append(
            _view(name, outer, f_mm or camera[0], (int(columns), int(image_lines)), pitch_mm, polynomial)
        )
    stated = {
        int(number): ControlPoint((_MM * x, _MM * y, _MM * z), (_MM * sx, _MM * sy, _MM * sz))
        for number, x, y, z, sx, sy, sz, *_ in lines.block(7)
    }
    objects = np.array([values[:4] for values in lines.block(4)]).reshape(-1, 4)
    marks = np.array([values[:4] for values in lines.block(4)]).reshape(-1, 4)
    return _network(tuple(views), objects, marks, sigma_px, {**stated, **control})


def _view(
    name: str,
    outer: list[float],
    f_mm: float,
    size: tuple[int, int],
    pitch_mm: float,
    polynomial: Polynomial,
) -> View:
    x, y, z, kappa, phi, omega = outer[:6]
    plain = View(
        name=name,
        first_column=0,
        end_column=size[0],
        pixel_x_mm=pitch_mm,
        pixel_y_mm=pitch_mm,
        handedness=1,
        f_mm=f_mm,
        x0_px=0.5 * size[0],
        y0_px=0.5 * size[1],
        omega_rad=0.0,
        phi_rad=0.0,
        kappa_rad=0.0,
        X0_mm=_MM * x,
        Y0_mm=_MM * y,
        Z0_mm=_MM * z,
        polynomial=polynomial,
    )
    return plain.with_axes(axes_from_omega_phi_kappa(omega, phi, kappa))


def _network(
    views: tuple[View, ...],
    objects: Array,
    marks: Array,
    sigma_px: float,
    control: Mapping[int, ControlPoint],
) -> Network:
    """Network of the object points that some image shows, in the order of their ids."""
    ids = np.unique(marks[:, 1]).astype(np.int32)
    xyz_mm, sigma_mm = np.zeros((len(ids), 3)), np.full((len(ids), 3), np.inf)
    at = np.searchsorted(ids, objects[:, 0])
    listed = (at < len(ids)) & (ids[np.minimum(at, len(ids) - 1)] == objects[:, 0])
    xyz_mm[at[listed]] = _MM * objects[listed, 1:]
    for number, point in control.items():
        place = np.flatnonzero(ids == number)
        if not len(place):
            raise InputError(
                f"control point {number} is on no image of the bundle project",
                "check that list of control points and project belong together",
            )
        xyz_mm[place], sigma_mm[place] = point.xyz_mm, point.sigma_mm
    return Network(
        views=views,
        view=marks[:, 0].astype(np.intp),
        target=np.searchsorted(ids, marks[:, 1]),
        xy_px=marks[:, 2:],
        sigma_px=np.full((len(marks), 2), sigma_px),
        target_mm=xyz_mm,
        target_sigma_mm=sigma_mm,
        ids=ids,
    )
