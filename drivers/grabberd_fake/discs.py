"""Targets, which are discs in space, and their images as ellipses in the picture; the image of the light."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_fake.light_options import LightOptions
from grabberd_fake.optics import HALF, Array, View


class Targets(NamedTuple):
    """N discs.

    Attributes:
        xyz_mm: (N, 3) their centres in the object's frame; `normal`: (N, 3) unit vectors, outward.
    """

    xyz_mm: Array
    normal: Array


def grid_numbers(rows: int, columns: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Row and column of every place of a grid, row by row; (rows · columns,) each."""
    row, column = np.divmod(np.arange(rows * columns, dtype=np.int32), np.int32(columns))
    return row, column


# The first harmonics of the boundary make the ellipse; eight points keep higher ones from aliasing into it.
_BOUNDARY = 8
_ANGLES = np.arange(_BOUNDARY) * (2 * np.pi / _BOUNDARY)
_COSINES, _SINES = np.cos(_ANGLES), np.sin(_ANGLES)


@dataclass(frozen=True, slots=True, eq=False)
class Ellipses:
    """N ellipses in frame pixels: center + a cos t + b sin t, each with its own weight.

    Attributes:
        center: (N, 2); `a`, `b`: (N, 2) conjugate half axes.
        weight: (N,) share of the exposure for which the target stood there.
    """

    center: Array
    a: Array
    b: Array
    weight: Array

    def __len__(self) -> int:
        return len(self.center)

    def select(self, which: NDArray[np.bool_] | NDArray[np.intp]) -> "Ellipses":
        """The ellipses chosen by a mask or index array."""
        return Ellipses(self.center[which], self.a[which], self.b[which], self.weight[which])

    @classmethod
    def joined(cls, parts: "Sequence[Ellipses]") -> "Ellipses":
        """All of them, in order."""
        return cls(
            np.concatenate([part.center for part in parts]),
            np.concatenate([part.a for part in parts]),
            np.concatenate([part.b for part in parts]),
            np.concatenate([part.weight for part in parts]),
        )


def disc_images(view: View, targets: Targets, diameter_mm: float) -> Ellipses:
    """Images of the discs with their perspective eccentricity, to second order of their size.

    The mean of a disc's boundary lies half as far from the image of its centre as the ellipse's centre does.
    """
    around = _rim(targets, diameter_mm / 2)
    count = len(targets.xyz_mm)
    points = view.ideal_image(around.reshape(-1, 3)).reshape(count, _BOUNDARY + 1, 2)
    rim, middle = points[:, 1:], points[:, 0]
    # The same displacement for the whole disc: mirror errors vary over 60 px and more, a disc covers a few.
    center = 2 * rim.mean(axis=1) - middle
    a = np.einsum("nkx,k->nx", rim, _COSINES * (2 / _BOUNDARY))
    b = np.einsum("nkx,k->nx", rim, _SINES * (2 / _BOUNDARY))
    return Ellipses(center + view.displacement(center), a, b, np.ones(count))


def _rim(targets: Targets, radius_mm: float) -> Array:
    """(N, 1 + _BOUNDARY, 3): the centre, then points of the boundary."""
    u, v = _in_plane(targets.normal)
    spokes = np.concatenate([[[0.0, 0.0]], np.column_stack([_COSINES, _SINES])]) * radius_mm
    basis = np.stack([u, v], axis=1)
    return targets.xyz_mm[:, np.newaxis] + spokes @ basis


def _in_plane(normal: Array) -> tuple[Array, Array]:
    """Two unit vectors (N, 3) that span the plane of each unit normal (N, 3)."""
    x, y, z = normal.T
    # Without branches or a singular direction (Duff et al., Building an orthonormal basis, revisited, 2017).
    sign = np.copysign(1.0, z)
    scale = -1.0 / (sign + z)
    cross = x * y * scale
    first = np.stack([1 + sign * x * x * scale, sign * cross, -sign * x], axis=1)
    return first, np.stack([cross, sign + y * y * scale, -y], axis=1)


def facing(view: View, targets: Targets, grazing_limit_deg: float) -> NDArray[np.bool_]:
    """(N,) True for discs whose front a view sees less obliquely than the limit."""
    sight = view.center_mm() - targets.xyz_mm
    along = np.einsum("nx,nx->n", sight, targets.normal)
    limit = math.cos(math.radians(grazing_limit_deg))
    return along > limit * np.sqrt(np.einsum("nx,nx->n", sight, sight))


def smeared(ellipses: Ellipses, start: Array, end: Array, step_px: float) -> Ellipses:
    """The ellipses over an exposure, as copies along the path of each.

    Args:
        ellipses: ellipses in the middle of the exposure.
        start: (N, 2) positions of the centres at its beginning, relative to the middle.
        end: (N, 2) positions at its end, likewise.
        step_px: greatest distance between copies. The path is a parabola through start, middle and end.
    """
    way = np.hypot(*start.T) + np.hypot(*end.T)
    copies = np.maximum(np.ceil(way / step_px), 1).astype(np.intp)
    if copies.max(initial=1) == 1:
        return ellipses
    which = np.repeat(np.arange(len(ellipses)), copies)
    number = np.arange(len(which)) - np.repeat(np.cumsum(copies) - copies, copies)
    time = ((2 * number + 1) / copies[which] - 1)[:, np.newaxis]
    moved = (end - start)[which] * (time / 2) + (end + start)[which] * (time * time / 2)
    copied = ellipses.select(which)
    return Ellipses(copied.center + moved, copied.a, copied.b, (1.0 / copies)[which])


def light_image(options: LightOptions, share: float) -> tuple[Ellipses, Ellipses]:
    """Its images in the left and the right half, each in frame pixels: it lies in one of them."""
    left = options.x_px < HALF
    return _disc(options, share, left), _disc(options, share, not left)


def _disc(options: LightOptions, share: float, drawn: bool) -> Ellipses:
    radius, count = options.diameter_px / 2, int(drawn)

    def rows(x: float, y: float) -> Array:
        return np.full((count, 2), (x, y))

    weight = np.full(count, share * options.brightness)
    return Ellipses(rows(options.x_px, options.y_px), rows(radius, 0.0), rows(0.0, radius), weight)
