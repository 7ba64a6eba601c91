"""The correlation matrix of the unknowns."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from grabberd.reports.figures.drawing import FAINT, INK, Svg, drawn
from grabberd.reports.names import COLOURS, symbol

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_STEPS = 41
"""Colours from −1 to 1: an odd number, so that the middle one is white."""


def correlation_svg(unknowns: Mapping[str, Any], strong_from: float, label: str) -> Svg:
    """Draw the lower triangle: blue negative, red positive, white none; names in the colour of their view.

    Args:
        unknowns: the document's part.
        strong_from: |ρ| above which a correlation is marked with a dot.
        label: alternative text.
    """
    from matplotlib import colormaps  # noqa: PLC0415

    names, matrix = unknowns["names"], np.array(unknowns["correlation"], dtype=np.float64)
    steps = colormaps["RdBu_r"].resampled(_STEPS)
    shown = np.ma.masked_array(matrix, mask=np.triu(np.ones(matrix.shape, bool)))

    def draw(canvas: "Figure") -> None:
        axes = canvas.add_axes((0.06, 0.06, 0.93, 0.93))
        cells = axes.pcolormesh(shown, cmap=steps, vmin=-1, vmax=1, edgecolors="white", linewidth=0.4)
        axes.set_aspect("equal", anchor="NW")
        axes.invert_yaxis()
        _name(axes, names)
        _mark_strong(axes, np.abs(matrix) > strong_from)
        scale = canvas.add_axes((0.48, 0.86, 0.28, 0.018))
        bar = canvas.colorbar(cells, cax=scale, ticks=[-1, -0.5, 0, 0.5, 1], orientation="horizontal")
        bar.set_label("correlation ρ")
        scale.spines[:].set_visible(False)
        for left, name in ((0.48, "left"), (0.53, "right"), (0.595, "both")):
            canvas.text(left, 0.92, name, color=COLOURS.get(name, INK), weight="bold")

    return drawn(draw, 128.0, label)


def _name(axes: "Axes", names: list[str]) -> None:
    middles = np.arange(len(names)) + 0.5
    labels = [symbol(name.partition(".")[2] or name) for name in names]
    paints = [COLOURS.get(name.partition(".")[0], INK) for name in names]
    axes.set_xticks(middles, labels, rotation=90)
    axes.set_yticks(middles, labels)
    for ticks in (axes.get_xticklabels(), axes.get_yticklabels()):
        for tick, paint in zip(ticks, paints, strict=True):
            tick.set_color(paint)
    axes.tick_params(length=0, pad=2, labelsize=7)
    axes.spines[:].set_visible(False)


def _mark_strong(axes: "Axes", strong: NDArray[np.bool_]) -> None:
    rows, columns = np.nonzero(np.tril(strong, -1))
    axes.plot(columns + 0.5, rows + 0.5, "o", color="white", markersize=2.6, mec=FAINT, mew=0.3)
