"""Arrows at their places in the picture: what residuals, distortion and local field have in common."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from grabberd.reports.figures.drawing import FAINT, INK, column_scale, nice
from grabberd.reports.names import colour
from grabberd.reports.numbers import significant

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]


def extent(document: Mapping[str, Any]) -> tuple[float, float]:
    """The picture's columns and lines; where they are not given, as far as views and image points reach."""
    image = document.get("image") or {}
    columns = image.get("columns") or max(view["end_column"] for view in document["views"])
    lines = image.get("lines") or 1 + max(
        (row["y_px"] for row in document.get("residuals") or []), default=575
    )
    return float(columns), float(lines)


def halves(axes: "Axes", document: Mapping[str, Any]) -> None:
    """The picture with its views: their limits, and their names in their colours."""
    columns, lines = extent(document)
    column_scale(axes, lines, columns)
    for view in document["views"]:
        if view["first_column"] > 0:
            axes.axvline(view["first_column"] - 0.5, color=FAINT, linewidth=0.5, linestyle=(0, (4, 3)))
        middle = (view["first_column"] + view["end_column"] - 1) / 2
        paint = colour(view["name"])
        axes.text(middle, -8, view["name"], color=paint, ha="center", va="bottom", weight="bold", size=8)
    axes.spines[["top", "right"]].set_visible(True)


def exaggeration(lengths_px: Sequence[float] | Array, longest_px: float) -> float:
    """By how much to enlarge vectors so that nearly all of them stay below a length; 1, 2, 5, 10 …"""
    lengths = np.asarray(lengths_px, dtype=np.float64)
    typical = float(np.quantile(lengths[np.isfinite(lengths)], 0.98)) if np.isfinite(lengths).any() else 0.0
    return nice(longest_px / typical) if typical > 0 else 1.0


def arrows(axes: "Axes", places_px: Array, vectors_px: Array, enlarged: float, paint: str) -> None:
    """Vectors (N, 2) at their places (N, 2), both in frame pixels."""
    axes.quiver(
        *places_px.T,
        *vectors_px.T,
        angles="xy",
        scale_units="xy",
        scale=1 / enlarged,
        color=paint,
        width=0.0016,
        headwidth=4,
        headlength=5,
        headaxislength=4.5,
        clip_on=False,
    )


def scale_arrow(axes: "Axes", enlarged: float, longest_px: float) -> float:
    """An arrow of a round length below the picture; returns that length in pixels of the picture."""
    length = nice(longest_px / enlarged)
    line = axes.get_ylim()[0] * 1.13
    end = axes.get_xlim()[1]
    start = end - length * enlarged
    arrows(axes, np.array([[start, line]]), np.array([[length, 0.0]]), enlarged, INK)
    said = f"{significant(length, 1)} px, enlarged {significant(enlarged, 1)} times"
    axes.text(start - 8, line, said, ha="right", va="center")
    return length
