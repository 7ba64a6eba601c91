"""Viewpoint of a model drawing, and its box with axes in mm."""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis import viewing_axes
from grabberd_liner.render.canvas import Canvas, Colour
from grabberd_liner.render.colours import ticks

Array = NDArray[np.float64]

SIDES = {
    "top": (-90.0, 90.0),
    "side": (-90.0, 0.0),
    "front": (0.0, 0.0),
    "oblique": (-60.0, 35.0),
}
"""Azimuth and elevation, in degrees, of named viewpoints; the cameras look from the top."""

AXES = ("x mm", "y mm", "z mm")

_GRID: Colour = (226, 226, 226)
_EDGE: Colour = (170, 170, 170)
_MARGIN_PX = 62.0
_BAR_PX = 74.0
_TICK_MM = 10.0
_EDGE_ON = 0.12
"""Foreshortening below which an axis is seen end on and gets no labels."""
_LABEL_PX = 15.0


@dataclass(frozen=True, slots=True)
class Box:
    """The space shown, mm: `low` (3,) to `high` (3,), multiples of ten."""

    low: Array
    high: Array

    @classmethod
    def round(cls, xyz_mm: Array) -> "Box":
        """The box round points (N, 3)."""
        low, high = np.nanmin(xyz_mm, axis=0), np.nanmax(xyz_mm, axis=0)
        low = np.floor(low / _TICK_MM) * _TICK_MM
        return cls(low, np.maximum(np.ceil(high / _TICK_MM) * _TICK_MM, low + _TICK_MM))

    def corners(self) -> Array:
        """(8, 3) corners of the box."""
        return np.array(list(product(*zip(self.low, self.high, strict=True))))


@dataclass(frozen=True, slots=True)
class Viewpoint:
    """A parallel projection of a box onto a canvas.

    Attributes:
        box: the space shown.
        axes: (3, 3) unit vectors to the right, up and toward the viewer.
        px_per_mm: scale.
        middle_px: (2,) position of the box's middle in the drawing.
    """

    box: Box
    axes: Array
    px_per_mm: float
    middle_px: Array

    @classmethod
    def before(cls, box: Box, azimuth_deg: float, elevation_deg: float, canvas: Canvas) -> "Viewpoint":
        """Viewpoint from a direction, scaled so that the box fills the canvas."""
        axes = np.stack(viewing_axes(azimuth_deg, elevation_deg))
        extent = np.ptp(box.corners() @ axes[:2].T, axis=0)
        room = np.array([canvas.width - 2 * _MARGIN_PX - _BAR_PX, canvas.height - 2 * _MARGIN_PX])
        middle = np.array([_MARGIN_PX + room[0] / 2, canvas.height / 2])
        return cls(box, axes, float((room / np.maximum(extent, 1e-9)).min()), middle)

    def places(self, xyz_mm: Array) -> Array:
        """(..., 2) pixels of points (..., 3)."""
        flat = (xyz_mm - (self.box.low + self.box.high) / 2) @ self.axes[:2].T
        return self.middle_px + self.px_per_mm * flat * [1.0, -1.0]

    def nearness(self, xyz_mm: Array) -> Array:
        """(...) nearness of points (..., 3) to the viewer, mm."""
        near: Array = xyz_mm @ self.axes[2]
        return near

    def draw(self, canvas: Canvas) -> None:
        """Draws the box's far walls with lines at round numbers, and the axes' numbers along its outline."""
        far = np.where(self.axes[2] > 0, self.box.low, self.box.high)
        for axis in range(3):
            if self._shortened(axis) < _EDGE_ON:
                continue
            for tick in ticks(self.box.low[axis], self.box.high[axis]):
                self._wall_lines(canvas, axis, tick, far)
            self._label(canvas, axis)

    def _shortened(self, axis: int) -> float:
        """Drawn length of an axis relative to its true length."""
        return float(np.hypot(*self.axes[:2, axis]))

    def _wall_lines(self, canvas: Canvas, axis: int, tick: float, far: Array) -> None:
        for other in (axis + 1) % 3, (axis + 2) % 3:
            ends = np.tile(far, (2, 1))
            ends[:, axis] = tick
            ends[:, other] = self.box.low[other], self.box.high[other]
            canvas.lines(self.places(ends), _GRID)

    def _label(self, canvas: Canvas, axis: int) -> None:
        edge = self._outline_edge(axis)
        start, end = self.places(edge)
        canvas.lines(np.stack([start, end]), _EDGE)
        outward = (start + end) / 2 - self.middle_px
        across = np.array([end[1] - start[1], start[0] - end[0]]) / np.linalg.norm(end - start)
        across = across if across @ outward >= 0 else -across
        span = self.box.high[axis] - self.box.low[axis]
        for tick in self._inner_ticks(axis):
            place = start + (tick - self.box.low[axis]) / span * (end - start)
            canvas.lines(np.stack([place, place + 4 * across]), _EDGE)
            canvas.words(f"{tick:.6g}", place + _LABEL_PX * across)
        beyond_px = _LABEL_PX + (25 if abs(across[0]) > abs(across[1]) else 20)
        canvas.words(AXES[axis], (start + end) / 2 + beyond_px * across, size_px=10)

    def _inner_ticks(self, axis: int) -> list[float]:
        """Round numbers without those at the corners, where two axes' numbers would collide, if possible."""
        low, high = self.box.low[axis], self.box.high[axis]
        every = ticks(low, high)
        inner = [tick for tick in every if low < tick < high]
        return inner if len(inner) > 1 else every

    def _outline_edge(self, axis: int) -> Array:
        """(2, 3) lowest edge of the box along an axis in the picture, or leftmost if the axis is upright."""
        low, high = self.box.low, self.box.high
        others = [other for other in range(3) if other != axis]
        edges = []
        for first, second in product(*((low[other], high[other]) for other in others)):
            edge = np.stack([low, high])
            edge[:, others[0]], edge[:, others[1]] = first, second
            edges.append(edge)
        along = self.axes[:2, axis]
        middle = self.places(np.array(edges)).mean(axis=1)
        upright = abs(along[1]) > 2 * abs(along[0])
        # The small term decides between edges at the same height in the picture.
        order = middle[:, 0] + 1e-3 * middle[:, 1] if upright else -middle[:, 1] + 1e-3 * middle[:, 0]
        return np.asarray(edges[int(np.argmin(order))])
