"""Networks and orientations in files of other programs, and their conventions of rotation and image frame.

Here the camera looks along −z with y up, `View.axes` lead from the object's frame into the camera's, and the
centre of the top left pixel is (0, 0) with y down. OpenPTV adds its distortion to the ideal point, as it is
here by default, but about the middle of the sensor and not about the principal point; an affinity follows.
Where these are not zero a view is right to first order in the distortion: enough to start an adjustment from,
not to measure with. PhotoModeler's bundle projects are read as DBAT reads them, with DBAT's control points:
lengths are in m there and in mm here; pixels keep their origin, so principal points are in that of the file.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array
from grabberd.core.calibration.adjustment.network import Network
from grabberd.core.calibration.control_points import ControlPoint, Lines
from grabberd.core.geometry import View
from grabberd.core.geometry.view import Polynomial, rotation_matrix
from grabberd.errors import InputError

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


_TARGET_COLUMNS = 8
_ORTHOGONAL = 1e-4
_SAME_ROTATION = 1e-3
"""Difference of two rotations by which angles and matrix, rounded to some digits, still state the same."""
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
        InputError: A file is not of this kind, or its matrix is no rotation, or not that of its angles.
    """
    values = Lines(text, f"orientation {name}").as_numbers(text.split(), 18, 21)
    rotation = np.array(values[6:15]).reshape(3, 3)
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > _ORTHOGONAL or np.linalg.det(rotation) < 0:
        raise InputError(f"the matrix of orientation {name} is no rotation", _HINT)
    if np.abs(rotation_matrix(*values[3:6]).T - rotation).max() > _SAME_ROTATION:
        raise InputError(
            f"orientation {name} states one rotation by its angles and another by its matrix",
            "correct the one that is wrong: the matrix follows from the angles omega, phi and kappa in rad",
        )
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
        InputError: The text is no such file, or an image point or calibration point stands in two lines.
    """
    lines = Lines(text, "the file of targets")
    count = lines.whole(lines.numbers(1)[0], "the number of targets")
    assigned, rows = dict[int, int](), []
    for _, (x, y, _pixels, _width, _height, _sum, point, *_) in lines.by_id("target", _TARGET_COLUMNS):
        at = lines.new(point, "calibration point", assigned) if point >= 0 else lines.whole(point, "point")
        rows.append((at, x, y))
    if len(rows) != count:
        why = f"the file of targets holds {len(rows)} lines and states {count}"
        raise InputError(why, "check that it is complete")
    found = np.array(rows, np.float64).reshape(-1, 3)
    return found[:, 0].astype(np.int32), pixels_from_corner(found[:, 1:])


def _distortion(added: str, name: str) -> tuple[float, ...]:
    """b1…b9 of the added parameters, to first order in shear and scale."""
    if not added.strip():
        return (0.0,) * 9
    lines = Lines(added, f"added parameters {name}")
    k1, k2, k3, p1, p2, scale, shear = lines.as_numbers(added.split(), 7, 7)
    if scale <= 0:
        raise lines.refusal(f"the scale in x is {scale:g}", "without added parameters it is 1")
    # x' = scale (x − shear y): half of the scale as b1, the rest is f; half of the shear as b2, the rest κ.
    return (-0.5 * (scale - 1.0), -0.5 * shear, k1, k2, k3, p1, p2, 0.0, 0.0)


_MM = 1000.0


def read_photomodeler(
    text: str,
    control: Mapping[int, ControlPoint],
    *,
    f_mm: float | None = None,
    polynomial: Polynomial = "correction",
) -> Network:
    """Read a bundle project as a network; everything but control points and image points is a starting value,
    the origin for an object point without a position.

    Views start without distortion, with square pixels and the principal point in the middle.

    Args:
        text: The export.
        control: Control points by id, which replace those of the file.
        f_mm: Rough focal length; None for that of the file.
        polynomial: Meaning of the views' polynomial; PhotoModeler's is a correction.

    Raises:
        InputError: The text is no such export, a control point is on none of its images, or the control
            points are in another unit than its object points.
    """
    lines = Lines(text, "the bundle project")
    lines.next()
    sizes = lines.numbers(4)
    columns, image_lines = (_positive(lines, lines.whole(one, "the picture's size")) for one in sizes[2:4])
    sigma_px = _positive(lines, lines.numbers(2)[1])
    camera = lines.numbers(5)
    camera_mm = _positive(lines, camera[0]), _positive(lines, camera[4])
    lines.next()
    sensor = Sensor(int(columns), int(image_lines), (camera_mm[1] / image_lines,) * 2)
    middle_px = 0.5 * sensor.columns, 0.5 * sensor.lines
    views: list[View] = []
    while line := lines.next():
        _check_place(lines, line.split(maxsplit=1)[0], len(views))
        name = line.split(maxsplit=1)[-1].replace("\\", "/").rpartition("/")[2].rpartition(".")[0]
        number, x, y, z, kappa, phi, omega, *_ = lines.numbers(7)
        _check_place(lines, f"{number:g}", len(views))
        for _ in range(4):
            lines.next()
        center_mm, axes = (_MM * x, _MM * y, _MM * z), axes_from_omega_phi_kappa(omega, phi, kappa)
        view = _view(name, sensor, f_mm or camera_mm[0], middle_px, center_mm, axes)
        views.append(replace(view, polynomial=polynomial))
    stated = _stated(lines, control)
    objects = {one: [_MM * x, _MM * y, _MM * z] for one, (x, y, z, *_) in lines.by_id("object point", 4)}
    marks = _marks(lines, len(views))
    _check_unit(control, objects)
    return _network(tuple(views), objects, marks, sigma_px, {**stated, **control})


def _positive(lines: Lines, value: float) -> float:
    """A number of the line read last that has to be above 0: a size, a length, a σ."""
    if value <= 0:
        raise lines.refusal(f"{value:g} is not above 0", "check that the file is an export of PhotoModeler")
    return value


def _check_place(lines: Lines, number: str, place: int) -> None:
    """Check that the images are numbered from 0 in their order, as the image points count them."""
    if number != str(place):
        why = f"expected image {place}, found {number[:20]!r}"
        raise lines.refusal(why, "export all images, in their order")


def _stated(lines: Lines, control: Mapping[int, ControlPoint]) -> dict[int, ControlPoint]:
    """The control points of the project that no given ones replace; of these it need not know any σ."""
    points = {}
    for one, (x, y, z, *others) in lines.by_id("control point", 7):
        if one not in control:
            sx, sy, sz = (_MM * sigma for sigma in lines.sigma(others[:3]))
            points[one] = ControlPoint((_MM * x, _MM * y, _MM * z), (sx, sy, sz))
    return points


def _marks(lines: Lines, images: int) -> Array:
    """(M, 4) image, point and pixels of the image points."""
    seen: dict[tuple[int, int], int] = {}
    marks = []
    for values in lines.block(4):
        image, point = (lines.whole(one, "the number") for one in values[:2])
        if not 0 <= image < images:
            raise lines.refusal(f"there is no image {image}", "check that the export is complete")
        if (image, point) in seen:
            before = seen[image, point]
            why = f"image {image} shows object point {point} in line {before} already"
            raise lines.refusal(why, "keep one")
        seen[image, point] = lines.number
        marks.append(values[:4])
    return np.array(marks).reshape(-1, 4)


_UNITS_APART = (1000.0, 100.0, 0.01, 0.001)
_UNIT_SHARE = 0.05


def _check_unit(control: Mapping[int, ControlPoint], objects: Mapping[int, Sequence[float]]) -> None:
    """Check that control points do not lie as far apart as the same object points in another unit."""
    both = sorted(control.keys() & objects.keys())
    if len(both) < 2:
        return
    places = [control[one].xyz_mm for one in both], [objects[one] for one in both]
    listed, own = (float(np.linalg.norm(np.ptp(one, axis=0))) for one in places)
    for times in _UNITS_APART:
        if abs(listed - times * own) < _UNIT_SHARE * listed:
            raise InputError(
                f"the control points are {times:g} times as far apart as these points of the bundle project",
                "state the unit of their list in its header, '# id, name, X, Y, Z (mm)'; it is m without",
            )


def _network(
    views: tuple[View, ...],
    objects: Mapping[int, Sequence[float]],
    marks: Array,
    sigma_px: float,
    control: Mapping[int, ControlPoint],
) -> Network:
    """Network of the object points that some image shows, in the order of their ids."""
    ids = np.unique(marks[:, 1]).astype(np.int32)
    xyz_mm, sigma_mm = np.zeros((len(ids), 3)), np.full((len(ids), 3), np.inf)
    for place, number in enumerate(ids.tolist()):
        xyz_mm[place] = objects.get(number, xyz_mm[place])
    for number, point in control.items():
        at = np.flatnonzero(ids == number)
        if not len(at):
            why = f"control point {number} is on no image of the bundle project"
            raise InputError(why, "check that list of control points and project belong together")
        xyz_mm[at], sigma_mm[at] = point.xyz_mm, point.sigma_mm
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
