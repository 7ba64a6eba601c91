"""The correlation matrix of the unknowns."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from grabberd.reports.figures.drawing import FAINT, INK, drawn
from grabberd.reports.markup import Html
from grabberd.reports.names import COLOURS, symbol

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_STEPS = 41


def correlation_svg(unknowns: Mapping[str, Any]) -> Html:
    """The lower triangle: blue negative, red positive, white none; names in the colour of their view."""
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
        _mark_strong(axes, matrix)
        place = canvas.add_axes((0.48, 0.86, 0.28, 0.018))
        bar = canvas.colorbar(cells, cax=place, ticks=[-1, -0.5, 0, 0.5, 1], orientation="horizontal")
        bar.set_label("correlation ρ")
        place.spines[:].set_visible(False)
        for left, name in ((0.48, "left"), (0.53, "right"), (0.595, "both")):
            canvas.text(left, 0.92, name, color=COLOURS.get(name, INK), weight="bold")

    return drawn(draw, 128.0, "Correlation matrix of the unknowns, lower triangle")


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


def _mark_strong(axes: "Axes", matrix: "np.ndarray[Any, np.dtype[np.float64]]") -> None:
    rows, columns = np.nonzero(np.tril(np.abs(matrix) > 0.95, -1))
    axes.plot(columns + 0.5, rows + 0.5, "o", color="white", markersize=2.6, mec=FAINT, mew=0.3)
