"""Figures of a guided test: curves, points and marks over common axes, side by side."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from grabberd.reports.figures.drawing import FAINT, WIDTH_MM, Svg, drawn

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOURS = ("#0072b2", "#b34700", "#007a5a", "#8a4f7d")
_HEIGHT_MM, _TOP_MM, _BOTTOM_MM, _LEFT_MM, _RIGHT_MM = 50.0, 8.0, 10.0, 17.0, 2.0
Curve = Mapping[str, Any]


def tested_svg(figures: Sequence[Sequence[Curve]], label: str) -> Svg:
    """Draw figures side by side.

    Args:
        figures: curves of each, which share their axes.
        label: alternative text.
    """
    part_mm = WIDTH_MM / len(figures)

    def draw(canvas: "Figure") -> None:
        for at, curves in enumerate(figures):
            box = (
                (at * part_mm + _LEFT_MM) / WIDTH_MM,
                _BOTTOM_MM / _HEIGHT_MM,
                (part_mm - _LEFT_MM - _RIGHT_MM) / WIDTH_MM,
                (_HEIGHT_MM - _TOP_MM - _BOTTOM_MM) / _HEIGHT_MM,
            )
            _draw(canvas.add_axes(box), curves)

    return drawn(draw, _HEIGHT_MM, label)


def _draw(axes: "Axes", curves: Sequence[Curve]) -> None:
    for at, curve in enumerate(curves):
        _draw_curve(axes, curve, _COLOURS[at % len(_COLOURS)], dashed=at > 0)
    first = curves[0]
    axes.set_xlabel(_titled(first["x_title"], first["x_unit"]))
    axes.set_ylabel(_titled(first["y_title"], first["y_unit"]))
    if all(first[f"{axis}_unit"] == "mm" for axis in "xy"):
        axes.set_aspect("equal", adjustable="datalim")
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 0.99), ncols=3, borderaxespad=0.0, handlelength=1.4)


def _draw_curve(axes: "Axes", curve: Curve, colour: str, *, dashed: bool) -> None:
    x, y, sigma = (np.array(curve[name], np.float64) for name in ("x", "y", "sigma"))
    if curve["style"] == "mark":
        width = 0.0 if not np.isfinite(sigma[0]) else float(sigma[0])
        axes.axvspan(x[0] - width, x[0] + width, color=colour, alpha=0.18, linewidth=0)
        axes.axvline(x[0], color=colour, linestyle=(0, (3, 2)), label=curve["title"])
    elif curve["style"] == "points":
        known = np.where(np.isfinite(sigma), sigma, 0.0)
        axes.errorbar(
            x,
            y,
            yerr=known,
            fmt="o",
            ms=2.5,
            color=colour,
            ecolor=FAINT,
            elinewidth=0.6,
            label=curve["title"],
        )
    else:
        axes.fill_between(x, y - sigma, y + sigma, color=colour, alpha=0.22, linewidth=0)
        axes.plot(x, y, color=colour, linestyle="--" if dashed else "-", label=curve["title"])


def _titled(title: str, unit: str) -> str:
    return title if unit in ("", "1") else f"{title} [{unit}]"
