"""Curves with bands of one σ, panel under panel, over time or over the phase of the mean cycle."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from grabberd.reports.columns import Array, Columns
from grabberd.reports.figures.drawing import FAINT, GREY, WIDTH_MM, drawn
from grabberd.reports.markup import Html

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#0072b2", "#b34700", "#007a5a", "#8a4f7d", "#7a6a00")
_TOP_MM, _BOTTOM_MM, _PANEL_MM, _GAP_MM = 8.0, 11.0, 27.0, 9.0
_LEFT_MM, _RIGHT_MM = 17.0, 3.0


class Curve(NamedTuple):
    """One line: (R,) values at `x`, with σ; NaN where they are not known."""

    name: str
    x: Array
    value: Array
    sigma: Array

    @classmethod
    def of(cls, name: str, columns: Columns, x: str, column: str) -> "Curve":
        """From a table's columns."""
        return cls(name, columns.numbers(x), columns.numbers(column), columns.sigma(column))

    def broken(self) -> "Curve":
        """With a hole where fields are missing, so that no line runs over it."""
        steps = np.diff(self.x)
        usual = np.median(steps) if len(steps) else 0.0
        at = np.flatnonzero(steps > 1.5 * usual) + 1
        return Curve(self.name, *(np.insert(part, at, np.nan) for part in self[1:]))


class Panel(NamedTuple):
    """What shares an axis, such as "distance [mm]"."""

    label: str
    curves: tuple[Curve, ...]

    @property
    def is_known(self) -> bool:
        """Whether there is anything to be drawn."""
        return any(np.isfinite(curve.value).any() for curve in self.curves)


def curves_svg(
    panels: Sequence[Panel], x_label: str, label: str, phases: Sequence[Mapping[str, Any]] = ()
) -> Html:
    """The panels, over a common axis.

    Args:
        panels: those that have anything.
        x_label: of the common axis.
        label: of the figure.
        phases: first, end and letter of each phase, which are marked.
    """
    height_mm = _TOP_MM + _BOTTOM_MM + len(panels) * _PANEL_MM + (len(panels) - 1) * _GAP_MM
    width = (WIDTH_MM - _LEFT_MM - _RIGHT_MM) / WIDTH_MM

    def draw(canvas: "Figure") -> None:
        first: Axes | None = None
        for index, panel in enumerate(panels):
            bottom = height_mm - _TOP_MM - (index + 1) * _PANEL_MM - index * _GAP_MM
            box = (_LEFT_MM / WIDTH_MM, bottom / height_mm, width, _PANEL_MM / height_mm)
            axes = canvas.add_axes(box, sharex=first)
            first = first or axes
            _panel(axes, panel, phases)
            axes.tick_params(labelbottom=index == len(panels) - 1)
            if index == len(panels) - 1:
                axes.set_xlabel(x_label)

    return drawn(draw, height_mm, label)


def _panel(axes: "Axes", panel: Panel, phases: Sequence[Mapping[str, Any]]) -> None:
    for curve, colour in zip(map(Curve.broken, panel.curves), COLOURS * len(panel.curves), strict=False):
        low, high = curve.value - curve.sigma, curve.value + curve.sigma
        axes.fill_between(curve.x, low, high, color=colour, alpha=0.22, linewidth=0)
        axes.plot(curve.x, curve.value, color=colour, label=curve.name)
    axes.margins(x=0.0, y=0.16 if phases else 0.05)
    axes.set_ylabel(panel.label)
    axes.locator_params(axis="y", nbins=5)
    axes.axhline(0.0, color=FAINT, linewidth=0.4) if _spans_zero(axes) else None
    _mark(axes, phases)
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 0.97), ncols=5, borderaxespad=0.0, handlelength=1.4)


def _spans_zero(axes: "Axes") -> bool:
    low, high = axes.get_ylim()
    return low < 0 < high


def _mark(axes: "Axes", phases: Sequence[Mapping[str, Any]]) -> None:
    for phase in phases:
        axes.axvline(phase["end"], color=FAINT, linewidth=0.4, linestyle=(0, (3, 2)))
        middle = (phase["first"] + phase["end"]) / 2
        axes.text(middle, 0.98, phase["phase"], transform=axes.get_xaxis_transform(), ha="center", va="top",
                  color=GREY, size=7,
                  bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.4})  # fmt: skip
