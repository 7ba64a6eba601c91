"""Fields of displacements over the views: the distortion, and the local residual field."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from grabberd.reports.figures.drawing import GREY, drawn
from grabberd.reports.figures.picture import Array, arrows, exaggeration, halves, scale_arrow
from grabberd.reports.markup import Html
from grabberd.reports.names import colour

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MOST_ARROWS = 12
_LONGEST_PX = 44.0


def field_svg(document: Mapping[str, Any], grids: Sequence[Mapping[str, Any]], label: str) -> Html:
    """Arrows and lines of equal length in px; each grid's rows run along its lines."""

    def draw(canvas: "Figure") -> None:
        axes = canvas.add_axes((0.08, 0.14, 0.90, 0.81))
        halves(axes, document)
        lengths = np.concatenate([np.hypot(*_vectors(grid)).ravel() for grid in grids])
        enlarged = exaggeration(lengths, _LONGEST_PX)
        for grid in grids:
            _contours(axes, grid)
            _arrows(axes, grid, enlarged)
        scale_arrow(axes, enlarged, _LONGEST_PX * 1.3)

    return drawn(draw, 122.0, label)


def _vectors(grid: Mapping[str, Any]) -> tuple[Array, Array]:
    return np.array(grid["dx_px"], dtype=np.float64), np.array(grid["dy_px"], dtype=np.float64)


def _contours(axes: "Axes", grid: Mapping[str, Any]) -> None:
    length = np.ma.masked_invalid(np.hypot(*_vectors(grid)))
    if min(length.shape) < 2 or length.count() < 4 or np.ptp(length) == 0:
        return
    lines = axes.contour(
        grid["columns"], grid["lines"], length, levels=6, colors=GREY, linewidths=0.5, zorder=1
    )
    axes.clabel(lines, fmt=lambda value: f"{value:.3g}", fontsize=6.5, inline_spacing=3, use_clabeltext=True)


def _arrows(axes: "Axes", grid: Mapping[str, Any], enlarged: float) -> None:
    dx, dy = _vectors(grid)
    every = (_stride(dx.shape[0]), _stride(dx.shape[1]))
    chosen = (slice(every[0] // 2, None, every[0]), slice(every[1] // 2, None, every[1]))
    columns, lines = np.meshgrid(
        np.array(grid["columns"], dtype=np.float64), np.array(grid["lines"], dtype=np.float64)
    )
    places = np.stack([columns[chosen].ravel(), lines[chosen].ravel()], axis=1)
    vectors = np.stack([dx[chosen].ravel(), dy[chosen].ravel()], axis=1)
    known = np.isfinite(vectors).all(axis=1)
    arrows(axes, places[known], vectors[known], enlarged, colour(grid["view"]))


def _stride(count: int) -> int:
    return -(-count // _MOST_ARROWS)
