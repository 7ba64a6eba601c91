"""Networks and orientations in files of other programs, and their conventions of rotation and image frame.

Here the camera looks along −z with y up, `View.axes` lead from the object's frame into the camera's, and the
centre of the top left pixel is (0, 0) with y down. OpenPTV adds its distortion to the ideal point, as it is
here by default, but about the middle of the sensor and not about the principal point; an affinity follows.
Where these are not zero a view is right to first order in the distortion: enough to start an adjustment from,
not to measure with. PhotoModeler's bundle projects are read as DBAT reads them, with DBAT's control points:
lengths are in m there and in mm here; pixels keep their origin, so principal points are in that of the file.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from grabberd.core.calibration.adjustment.network import Network
from grabberd.core.geometry import View
from grabberd.core.geometry.view import Polynomial, rotation_matrix
from grabberd.errors import InputError

Array = NDArray[np.float64]

_CORNER_PX = 0.5


def axes_from_omega_phi_kappa(omega_deg: float, phi_deg: float, kappa_deg: float) -> Array:
    """Convert ω, φ, κ of DBAT and PhotoModeler into axes (3, 3).

    They turn the coordinates about x, then the new y, then the new z, as here; PhotoModeler lists them in the
    opposite order.
    """
    omega, phi, kappa = np.radians([omega_deg, phi_deg, kappa_deg]).tolist()
    return rotation_matrix(omega, phi, kappa)


def axes_from_openptv(rotation: Sequence[Sequence[float]] | Array) -> Array:
    """Convert the matrix of an OpenPTV orientation file (3, 3), which leads from the camera to the object."""
    return np.asarray(rotation, np.float64).T.copy()


def pixels_from_corner(xy_px: Array) -> Array:
    """Convert pixels (N, 2) whose origin is the top left corner of the picture (OpenPTV, COLMAP), y down."""
    return xy_px - _CORNER_PX


def pixels_from_sensor(xy_mm: Array, columns: int, lines: int, pixel_mm: tuple[float, float]) -> Array:
    """Convert sensor coordinates in mm, y up from the middle of the picture, into pixels; both (N, 2)."""
    middle = 0.5 * np.array([columns - 1, lines - 1])
    return np.asarray(middle + xy_mm * (1.0, -1.0) / np.asarray(pixel_mm), np.float64)


class Lines:
    """Lines of a text, read one by one.

    Attributes:
        what: Description of the text for messages.
        number: Number of the line read last, from 1.
    """

    def __init__(self, text: str, what: str) -> None:
        self.what = what
        self.number = 0
        self._lines = text.splitlines()

    def next(self) -> str:
        """Read a line.

        Raises:
            InputError: There is none left.
        """
        if self.number >= len(self._lines):
            raise InputError(f"{self.what} ends after line {self.number}", "check that the file is complete")
        self.number += 1
        return self._lines[self.number - 1].strip()

    def numbers(self, least: int) -> list[float]:
        """Read the numbers of a line.

        Raises:
            InputError: There are fewer than `least`, or something else.
        """
        return self.as_numbers(self.next().split(), least)

    def as_numbers(self, words: Sequence[str], least: int) -> list[float]:
        """Convert the words of the line read last.

        Raises:
            InputError: There are fewer than `least`, or one is no number.
        """
        try:
            values = [float(word) for word in words]
        except ValueError:
            values = []
        if len(values) < least:
            raise InputError(
                f"{self.what}, line {self.number}: expected {least} numbers, found {' '.join(words)[:60]!r}",
                "check that the file is of the kind that is read",
            )
        return values

    def rest(self) -> Iterator[str]:
        """Read the other lines; those that are empty or begin with # are skipped."""
        while self.number < len(self._lines):
            line = self.next()
            if line and not line.startswith("#"):
                yield line

    def block(self, least: int) -> Iterator[list[float]]:
        """Read lines of numbers up to an empty line or the end."""
        while self.number < len(self._lines) and (line := self.next()):
            yield self.as_numbers(line.split(), least)


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
    view = _view(name, sensor, distance, principal, values[:3], axes_from_openptv(left @ right))
    return replace(view, b=_distortion(added, name))


def _view(
    name: str,
    sensor: Sensor,
    f_mm: float,
    principal_px: Sequence[float],
    center_mm: Sequence[float],
    axes: Array,
) -> View:
    """Right-handed view without distortion."""
    plain = View(
        name=name,
        first_column=0,
        end_column=sensor.columns,
        pixel_x_mm=sensor.pixel_mm[0],
        pixel_y_mm=sensor.pixel_mm[1],
        handedness=1,
        f_mm=f_mm,
        x0_px=float(principal_px[0]),
        y0_px=float(principal_px[1]),
        omega_rad=0.0,
        phi_rad=0.0,
        kappa_rad=0.0,
        X0_mm=center_mm[0],
        Y0_mm=center_mm[1],
        Z0_mm=center_mm[2],
    )
    return plain.with_axes(axes)


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


def _distortion(added: str, name: str) -> tuple[float, ...]:
    """b1…b9 of the added parameters, to first order in shear and scale."""
    if not added.strip():
        return (0.0,) * 9
    values: Sequence[float] = Lines(added, f"added parameters {name}").as_numbers(added.split(), 7)
    k1, k2, k3, p1, p2, scale, shear = values[:7]
    # x' = scale (x − shear y): half of the scale as b1, the rest is f; half of the shear as b2, the rest κ.
    return (-0.5 * (scale - 1.0), -0.5 * shear, k1, k2, k3, p1, p2, 0.0, 0.0)


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
    sensor = Sensor(int(columns), int(image_lines), (camera[4] / image_lines,) * 2)
    middle_px = 0.5 * sensor.columns, 0.5 * sensor.lines
    views = []
    while line := lines.next():
        name = line.split(maxsplit=1)[-1].replace("\\", "/").rpartition("/")[2].rpartition(".")[0]
        _, x, y, z, kappa, phi, omega, *_ = lines.numbers(7)
        for _ in range(4):
            lines.next()
        center_mm, axes = (_MM * x, _MM * y, _MM * z), axes_from_omega_phi_kappa(omega, phi, kappa)
        view = _view(name, sensor, f_mm or camera[0], middle_px, center_mm, axes)
        views.append(replace(view, polynomial=polynomial))
    stated = {
        int(number): ControlPoint((_MM * x, _MM * y, _MM * z), (_MM * sx, _MM * sy, _MM * sz))
        for number, x, y, z, sx, sy, sz, *_ in lines.block(7)
    }
    objects = np.array([values[:4] for values in lines.block(4)]).reshape(-1, 4)
    marks = np.array([values[:4] for values in lines.block(4)]).reshape(-1, 4)
    return _network(tuple(views), objects, marks, sigma_px, {**stated, **control})


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
