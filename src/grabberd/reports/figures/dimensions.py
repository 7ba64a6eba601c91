"""Dimension lines and angles, as on a drawing."""

from typing import TYPE_CHECKING

import numpy as np

from grabberd.reports.figures.drawing import INK
from grabberd.reports.figures.picture import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_PAPER = {"facecolor": "white", "edgecolor": "none", "pad": 1.2, "alpha": 0.85}


def dimension(axes: "Axes", start: Array, end: Array, said: str, share: float = 0.5) -> None:
    """A line with an arrow head at either end, and its length in words along it, at a share of its way."""
    axes.annotate(
        "",
        tuple(end),
        xytext=tuple(start),
        arrowprops={"arrowstyle": "<|-|>", "color": INK, "linewidth": 0.5, "shrinkA": 0, "shrinkB": 0,
                    "mutation_scale": 6},
    )  # fmt: skip
    along = end - start
    turned = float(np.degrees(np.arctan2(along[1], along[0])))
    turned = turned - 180.0 if turned > 90.0 + 1e-6 else turned
    place = start + share * along
    axes.text(
        float(place[0]),
        float(place[1]),
        said,
        rotation=turned,
        rotation_mode="anchor",
        ha="center",
        va="center",
        bbox=_PAPER,
        zorder=5,
    )


def angle(axes: "Axes", apex: Array, ends: tuple[Array, Array], said: str) -> None:
    """The angle at a point between the directions to two others, with its arc."""
    directions = [end - apex for end in ends]
    radius = 0.30 * min(float(np.linalg.norm(direction)) for direction in directions)
    turns = [float(np.arctan2(direction[1], direction[0])) for direction in directions]
    arc = np.linspace(turns[0], turns[1], 33)
    axes.plot(apex[0] + radius * np.cos(arc), apex[1] + radius * np.sin(arc), color=INK, linewidth=0.5)
    for end in ends:
        axes.plot(*zip(apex, end, strict=True), color=INK, linewidth=0.5)
    quarter = turns[0] + 0.25 * (turns[1] - turns[0])
    place = apex + 1.14 * radius * np.array([np.cos(quarter), np.sin(quarter)])
    axes.text(float(place[0]), float(place[1]), said, ha="center", va="center", bbox=_PAPER, zorder=5)
