"""Residual vectors of all image points, at their places in the picture."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from grabberd.reports.figures.drawing import FAINT, INK, drawn
from grabberd.reports.figures.picture import arrows, exaggeration, halves, scale_arrow
from grabberd.reports.markup import Html
from grabberd.reports.names import colour

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LONGEST_PX = 40.0


def residuals_svg(document: Mapping[str, Any]) -> Html:
    """The whole picture with both views' residuals; blunders are ringed and named."""

    def draw(canvas: "Figure") -> None:
        axes = canvas.add_axes((0.08, 0.14, 0.90, 0.81))
        halves(axes, document)
        _vectors(axes, document["residuals"])
        _blunders(axes, document)

    return drawn(draw, 122.0, "Residual vectors of the image points in both views, enlarged")


def _vectors(axes: "Axes", residuals: Sequence[Mapping[str, Any]]) -> None:
    lengths = [float(np.hypot(row["dx_px"], row["dy_px"])) for row in residuals]
    enlarged = exaggeration(lengths, _LONGEST_PX)
    for view in sorted({row["view"] for row in residuals}):
        rows = [row for row in residuals if row["view"] == view]
        places = np.array([(row["x_px"], row["y_px"]) for row in rows])
        vectors = np.array([(row["dx_px"], row["dy_px"]) for row in rows])
        axes.plot(*places.T, ".", color=FAINT, markersize=1.5, markeredgewidth=0)
        arrows(axes, places, vectors, enlarged, colour(view))
    scale_arrow(axes, enlarged, _LONGEST_PX * 1.3)


def _blunders(axes: "Axes", document: Mapping[str, Any]) -> None:
    """Rings at the blunders' own places, or at those of their image points where they stayed in."""
    places = {(row["view"], row["target"]): (row["x_px"], row["y_px"]) for row in document["residuals"]}
    for row in document.get("blunders") or []:
        own = (row["x_px"], row["y_px"]) if row.get("x_px") is not None else None
        if place := own or places.get((row["view"], row["target"])):
            axes.plot(*place, "o", mfc="none", mec=INK, markersize=13, mew=0.9)
            axes.annotate(f"{row['target']}", place, (8, 6), textcoords="offset points", weight="bold")
