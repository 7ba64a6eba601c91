"""The grid model from any side (paper 3.7): facets and grid lines, with nearer parts hiding farther ones."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis import PER_PITCH, Mesh
from grabberd_liner.render.canvas import INK, Canvas, Colour
from grabberd_liner.render.colours import PLAIN, Scale, draw_bar
from grabberd_liner.render.viewpoint import Box, Viewpoint

Array = NDArray[np.float64]

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


def _on_grid(line: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Mask of the mesh lines that pass through targets."""
    on: NDArray[np.bool_] = (line - PER_PITCH // 2) % PER_PITCH == 0
    return on


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
    shaded: Array = bright[:, np.newaxis] * colours
    return shaded
