"""Errors of targets that took no part in the adjustment, beside what was predicted of them."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from grabberd.reports.figures.drawing import INK, PALE, drawn
from grabberd.reports.markup import Html

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def validation_svg(points: Sequence[Mapping[str, Any]]) -> Html:
    """For X, Y and Z: the error over the predicted σ, with the band of 1.96 σ."""

    def draw(canvas: "Figure") -> None:
        for index, axis in enumerate("xyz"):
            axes = canvas.add_axes((0.10 + 0.325 * index, 0.19, 0.235, 0.70))
            _panel(axes, axis, points)

    return drawn(
        draw, 66.0, "Errors of the held-out targets in X, Y and Z over their predicted standard deviation"
    )


def _panel(axes: "Axes", axis: str, points: Sequence[Mapping[str, Any]]) -> None:
    sigma = np.array([row[f"sigma_{axis}_mm"] for row in points], dtype=np.float64)
    error = np.array([row[f"d{axis}_mm"] for row in points], dtype=np.float64)
    width = max(float(sigma.max() - sigma.min()), 0.1 * float(sigma.max()))
    reach = np.array([max(0.0, float(sigma.min()) - 0.15 * width), float(sigma.max()) + 0.15 * width])
    axes.fill_between(reach, -1.96 * reach, 1.96 * reach, color=PALE, linewidth=0, label="± 1.96 σ")
    axes.axhline(0.0, color=INK, linewidth=0.4)
    axes.plot(sigma, error, "o", color=INK, markersize=2.2, mew=0)
    highest = 1.15 * max(float(np.abs(error).max()), 1.96 * float(reach[1]))
    axes.set_xlim(float(reach[0]), float(reach[1]))
    axes.set_ylim(-highest, highest)
    axes.locator_params(axis="x", nbins=4)
    axes.set_title(axis.upper())
    axes.set_xlabel("predicted σ [mm]")
    if axis == "x":
        axes.set_ylabel("error [mm]")
        axes.legend(loc="upper left", handlelength=1.2, borderaxespad=0.0)
