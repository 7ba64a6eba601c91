"""The grid model from any side (paper 3.7): facets and grid lines, nearer parts hiding farther ones, in a
box with axes in mm, with a colour scale; lines, areas and text are drawn at twice the size and then reduced.
"""

from dataclasses import dataclass
from itertools import product
from typing import Literal, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array, Indices, Mask
from grabberd_liner.analysis.camera import viewing_axes
from grabberd_liner.analysis.surface.surface import PER_PITCH, Mesh

Colour = tuple[float, float, float]
"""Blue, green, red, 0 to 255."""

PAPER: Colour = (255, 255, 255)
INK: Colour = (60, 50, 45)

# Hard edges at twice the size, in 1/16 pixel, then averaged: neighbouring facets meet without a seam.
_LARGER = 2
_SHIFT = 4
_FONT = cv2.FONT_HERSHEY_SIMPLEX
_FONT_PX = 22.0
"""Height of the font's capitals at scale 1, in pixels."""


class Canvas:
    """A picture being drawn; positions are (x, y) in its pixels, y down."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        self._picture = np.full((height * _LARGER, width * _LARGER, 3), PAPER, np.uint8)

    def area(self, corners: Array, colour: Colour) -> None:
        """Fills a convex polygon, (K, 2) corners."""
        cv2.fillConvexPoly(self._picture, _fixed(corners), colour, cv2.LINE_8, _SHIFT)

    def lines(self, corners: Array, colour: Colour) -> None:
        """Draws a polyline through (K, 2) positions."""
        cv2.polylines(
            self._picture, [_fixed(corners)], isClosed=False, color=colour, thickness=_LARGER,
            lineType=cv2.LINE_8, shift=_SHIFT,
        )  # fmt: skip

    def words(
        self,
        text: str,
        place: Array,
        colour: Colour = INK,
        size_px: float = 9.0,
        align: Literal["left", "middle", "right"] = "middle",
    ) -> None:
        """Writes text, vertically centred on a position; ASCII only, as OpenCV's fonts have no more."""
        scale = size_px * _LARGER / _FONT_PX
        (width, height), _ = cv2.getTextSize(text, _FONT, scale, _LARGER - 1)
        share = {"left": 0.0, "middle": 0.5, "right": 1.0}[align]
        corner = (round(place[0] * _LARGER - share * width), round(place[1] * _LARGER + height / 2))
        cv2.putText(self._picture, text, corner, _FONT, scale, colour, _LARGER - 1, cv2.LINE_AA)

    def picture(self) -> NDArray[np.uint8]:
        """(height, width, 3) uint8, blue, green, red."""
        size = (self.width, self.height)
        return np.asarray(cv2.resize(self._picture, size, interpolation=cv2.INTER_AREA), np.uint8)


def _fixed(corners: Array) -> NDArray[np.int32]:
    """Fixed-point coordinates of the enlarged drawing, whose pixel centres are at whole numbers."""
    enlarged = (corners + 0.5) * _LARGER - 0.5
    return np.round(enlarged * (1 << _SHIFT)).astype(np.int32)


UNKNOWN: Colour = (200, 200, 200)
"""Colour of unknown values."""
PLAIN: Colour = (226, 196, 158)
"""Colour of a surface without values."""

_STEPS = 64
_FEWEST_TICKS = 3


@dataclass(frozen=True, slots=True)
class Scale:
    """Range of values that a colour scale covers.

    Attributes:
        label: quantity and unit, in ASCII.
        low: value of the first colour; `high`: value of the last.
    """

    label: str
    low: float
    high: float

    @classmethod
    def over(cls, label: str, values: Array) -> "Scale":
        """Scale from the 2nd to the 98th percentile, so that single outliers do not flatten the colours."""
        known = values[np.isfinite(values)]
        low, high = np.percentile(known, [2, 98]) if len(known) else (0.0, 1.0)
        # A quantity that is the same everywhere needs some range, too: colours are shares of it.
        return cls(label, float(low), float(max(high, low + 1e-9 + 1e-6 * abs(low))))

    def colours(self, values: Array) -> Array:
        """(..., 3) blue, green, red, 0 to 255, of values (...); those beyond get the end colours."""
        share = np.clip((np.nan_to_num(values) - self.low) / (self.high - self.low), 0, 1)
        levels = np.round(share * 255).astype(np.uint8).reshape(-1, 1)
        mapped = cv2.applyColorMap(levels, cv2.COLORMAP_VIRIDIS).reshape(*values.shape, 3)
        return np.where(np.isfinite(values)[..., np.newaxis], mapped, UNKNOWN).astype(float)


def draw_bar(canvas: Canvas, scale: Scale) -> None:
    """Draws the colour bar along the right edge, with its values and its label."""
    left, right = canvas.width - 74.0, canvas.width - 58.0
    top, bottom = 0.16 * canvas.height, 0.84 * canvas.height
    edges = np.linspace(bottom, top, _STEPS + 1)
    middle = scale.low + (np.arange(_STEPS) + 0.5) / _STEPS * (scale.high - scale.low)
    for below, above, colour in zip(edges[:-1], edges[1:], scale.colours(middle), strict=True):
        corners = np.array([[left, below], [right, below], [right, above], [left, above]])
        canvas.area(corners, (colour[0], colour[1], colour[2]))
    for tick in ticks(scale.low, scale.high):
        y = bottom + (tick - scale.low) / (scale.high - scale.low) * (top - bottom)
        canvas.lines(np.array([[right, y], [right + 4, y]]), INK)
        canvas.words(f"{tick:.6g}", np.array([right + 7, y]), align="left")
    canvas.words(scale.label, np.array([canvas.width - 10.0, top - 18]), align="right")


def ticks(low: float, high: float, most: int = 6) -> list[float]:
    """Three to `most` round numbers from low to high, 1, 2 or 5 times a power of ten apart."""
    raw = (high - low) / most
    power = 10.0 ** np.floor(np.log10(raw))
    step = next(each * power for each in (1.0, 2.0, 5.0, 10.0) if each * power >= raw * (1 - 1e-9))
    first, last = np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9)
    # The step that gives at most six numbers can give one or two, which do not show a scale.
    if last - first + 1 < _FEWEST_TICKS:
        step /= 2
        first, last = np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9)
    return [float(number * step) + 0.0 for number in np.arange(first, last + 1)]


SIDES = {"top": (-90.0, 90.0), "side": (-90.0, 0.0), "front": (0.0, 0.0), "oblique": (-60.0, 35.0)}
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
        return xyz_mm @ self.axes[2]

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


WIRE: Colour = (70, 58, 50)
_LIGHT = np.array([-0.35, 0.45, 0.82])
"""Direction of the light: from the left, above and before the picture."""
_LEAST_LIGHT = 0.45
_INSIDE = 0.72
"""Brightness of the inner face relative to the outer."""


class Look(NamedTuple):
    """Drawing style of a model.

    Attributes:
        azimuth_deg: azimuth of the viewpoint; `elevation_deg`: its elevation, see `viewing_axes`.
        width: width of the picture in pixels; `height`: its height.
    """

    azimuth_deg: float = -60.0
    elevation_deg: float = 35.0
    width: int = 960
    height: int = 600


class Painted(NamedTuple):
    """Values of the facets, (P − 1, Q − 1), and the scale of their colours."""

    values: Array
    scale: Scale


def wire_model(
    mesh: Mesh | None, outward: float, box: Box, look: Look, painted: Painted | None = None, caption: str = ""
) -> NDArray[np.uint8]:
    """Draws a mesh: (height, width, 3) uint8, blue, green, red.

    Args:
        mesh: mesh of the surface; None draws only the box.
        outward: 1.0 if X_u × X_v points outward, else −1.0; the inner face is drawn darker.
        box: space to show.
        look: viewpoint and size.
        painted: colours by value; None for shading only.
        caption: text above the drawing, ASCII.
    """
    canvas = Canvas(look.width, look.height)
    viewpoint = Viewpoint.before(box, look.azimuth_deg, look.elevation_deg, canvas)
    viewpoint.draw(canvas)
    if mesh is not None:
        _draw_facets(canvas, viewpoint, mesh, outward, painted)
    if painted is not None:
        draw_bar(canvas, painted.scale)
    canvas.words(caption, np.array([16.0, 18.0]), INK, 10.0, "left")
    return canvas.picture()


def _draw_facets(
    canvas: Canvas, viewpoint: Viewpoint, mesh: Mesh, outward: float, painted: Painted | None
) -> None:
    """Painter's algorithm: the farthest facet first, each with its pieces of the grid lines."""
    corners, xyz = mesh.corners(), mesh.xyz_mm.reshape(-1, 3)
    four = xyz[corners]
    colours = _shaded(viewpoint, four, outward, painted, mesh)
    places = viewpoint.places(xyz)[corners]
    row, column = np.nonzero(mesh.supported)
    edges = np.stack([_on_grid(column), _on_grid(row + 1), _on_grid(column + 1), _on_grid(row)], axis=1)
    for index in np.argsort(viewpoint.nearness(four.mean(axis=1))):
        corner, colour = places[index], colours[index]
        canvas.area(corner, (colour[0], colour[1], colour[2]))
        for first in np.flatnonzero(edges[index]):
            canvas.lines(corner[[first, (first + 1) % 4]], WIRE)


def _on_grid(line: Indices) -> Mask:
    """Mask of the mesh lines that pass through targets."""
    return (line - PER_PITCH // 2) % PER_PITCH == 0


def _shaded(viewpoint: Viewpoint, four: Array, outward: float, painted: Painted | None, mesh: Mesh) -> Array:
    """(F, 3) the facets' colours under the light."""
    normal = np.cross(four[:, 2] - four[:, 0], four[:, 3] - four[:, 1]) * outward
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    seen = normal @ viewpoint.axes.T
    outside = seen[:, 2] >= 0
    seen = np.where(outside[:, np.newaxis], seen, -seen)
    bright = _LEAST_LIGHT + (1 - _LEAST_LIGHT) * np.clip(seen @ _LIGHT / np.linalg.norm(_LIGHT), 0, 1)
    bright *= np.where(outside, 1.0, _INSIDE)
    colours: Array = np.tile(PLAIN, (len(four), 1))
    if painted is not None:
        bright, colours = (1 + bright) / 2, painted.scale.colours(painted.values[mesh.supported])
    return bright[:, np.newaxis] * colours
