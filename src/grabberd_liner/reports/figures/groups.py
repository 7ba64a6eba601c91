"""Quantities of many captures: by group, and over milkings or days; small panels, two in a row."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from grabberd.core.arrays import Array
from grabberd.reports.figures.drawing import GREY, INK, WIDTH_MM, Svg, drawn

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Quantity = Mapping[str, Any]

PANELS = 6
"""Panels of one figure, which fill a page."""
_COLOURS = ("#0072b2", "#b34700", "#007a5a", "#8a4f7d", "#7a6a00", "#444444")
_MARKERS = ("o", "s", "^", "D", "v", "P")
_IN_A_ROW = 2
_PANEL_MM, _TOP_MM, _BOTTOM_MM, _TURNED_MM, _LEFT_MM, _RIGHT_MM = 42.0, 6.0, 10.0, 8.0, 16.0, 4.0
_SPREAD = 0.56
"""Width over which the captures of a group are spread; the groups are 1 apart."""
_MOST_LEVEL, _LONGEST_LEVEL = 8, 40
"""Groups whose names, and letters of these together, still fit beside each other."""
_LONGEST_NAME = 20
_MOST_BARS = 60
"""Captures of a panel up to which every σ can be told from the others."""


def groups_svg(quantities: Sequence[Quantity], label: str) -> Svg:
    """Draw every capture with its σ by group, and the groups' means with their 95 % intervals.

    Args:
        quantities: parts of the document, `PANELS` at most.
        label: alternative text.
    """
    is_turned = any(not _is_level(one["groups"]) for one in quantities)
    return _panels(quantities, _groups, label, _TURNED_MM if is_turned else 0.0)


def trends_svg(quantities: Sequence[Quantity], over: str, label: str) -> Svg:
    """Draw every capture with its σ over milkings or days, and the line of each group.

    Args:
        quantities: parts of the document, `PANELS` at most.
        over: label of the axis.
        label: alternative text.
    """

    def draw(axes: "Axes", quantity: Quantity) -> None:
        _trend(axes, quantity)
        axes.set_xlabel(over)

    return _panels(quantities, draw, label)


def _panels(
    quantities: Sequence[Quantity], draw: "Callable[[Axes, Quantity], None]", label: str, more_mm: float = 0.0
) -> Svg:
    rows, bottom_mm = -(-len(quantities) // _IN_A_ROW), _BOTTOM_MM + more_mm
    row_mm, column_mm = _TOP_MM + _PANEL_MM + bottom_mm, WIDTH_MM / _IN_A_ROW
    height_mm = rows * row_mm

    def canvas_drawn(canvas: "Figure") -> None:
        for index, quantity in enumerate(quantities):
            row, column = divmod(index, _IN_A_ROW)
            box = (
                (column * column_mm + _LEFT_MM) / WIDTH_MM,
                1 - ((row + 1) * row_mm - bottom_mm) / height_mm,
                (column_mm - _LEFT_MM - _RIGHT_MM) / WIDTH_MM,
                _PANEL_MM / height_mm,
            )
            axes = canvas.add_axes(box)
            draw(axes, quantity)
            unit = "" if quantity["unit"] in ("", "1") else f" [{quantity['unit']}]"
            axes.set_title(f"{quantity['title']}{unit}")
            axes.locator_params(axis="y", nbins=5)

    return drawn(canvas_drawn, height_mm, label)


def _groups(axes: "Axes", quantity: Quantity) -> None:
    group, names = np.array(quantity["values"]["group"]), quantity["groups"]
    value, sigma = _values(quantity)
    for number, mean in enumerate(quantity["means"]):
        rows = np.flatnonzero(group == number)
        # In the order of time, so that a drift within a group is seen.
        at = number + _SPREAD * ((np.arange(len(rows)) + 0.5) / len(rows) - 0.5)
        _captures(axes, at, value[rows], sigma[rows], number)
        _mean(axes, number, mean)
    axes.set_xlim(-0.6, len(names) - 0.4)
    turned = {} if _is_level(names) else {"rotation": 30, "ha": "right", "fontsize": 6}
    shown = [_cut(name, _LONGEST_NAME) for name in names]
    axes.set_xticks(range(len(names)), shown, **turned)  # type: ignore[arg-type]


def _cut(name: str, most: int) -> str:
    """Cut a name that has more letters."""
    return name if len(name) <= most else f"{name[: most - 1]}…"


def _is_level(names: Sequence[str]) -> bool:
    """True if the names of groups fit beside each other."""
    return len(names) <= _MOST_LEVEL and sum(map(len, names)) <= _LONGEST_LEVEL


def _mean(axes: "Axes", at: float, mean: Mapping[str, Any]) -> None:
    ends = (at - 0.36, at + 0.36)
    axes.plot(ends, [mean["value"]] * 2, color=INK, linewidth=1.0)
    half = mean["half_width"]
    if half is not None:
        axes.fill_between(
            ends, mean["value"] - half, mean["value"] + half, color=GREY, alpha=0.18, linewidth=0
        )


def _trend(axes: "Axes", quantity: Quantity) -> None:
    group, names = np.array(quantity["values"]["group"]), quantity["groups"]
    value, sigma = _values(quantity)
    place = np.array(quantity["values"]["place"], np.float64)
    slopes = quantity["slopes"] or [None] * len(names)
    for number, (name, slope) in enumerate(zip(names, slopes, strict=True)):
        rows = np.flatnonzero((group == number) & np.isfinite(place))
        _captures(axes, place[rows], value[rows], sigma[rows], number, name)
        if slope is not None:
            ends = np.array([place[rows].min(), place[rows].max()])
            line = value[rows].mean() + slope["value"] * (ends - place[rows].mean())
            axes.plot(ends, line, color=_COLOURS[number % len(_COLOURS)], linewidth=1.0)
    if 1 < len(names) <= _MOST_LEVEL:
        axes.legend(loc="best", handlelength=1.0, fontsize=6)


def _values(quantity: Quantity) -> tuple[Array, Array]:
    values = quantity["values"]
    return np.array(values["value"], np.float64), np.array(values["sigma"], np.float64)


def _captures(axes: "Axes", at: Array, value: Array, sigma: Array, number: int, name: str = "") -> None:
    colour, marker = _COLOURS[number % len(_COLOURS)], _MARKERS[number % len(_MARKERS)]
    if len(at) <= _MOST_BARS:
        axes.errorbar(at, value, np.nan_to_num(sigma), fmt="none", ecolor=colour, elinewidth=0.6, alpha=0.7)
    axes.plot(at, value, marker, color=colour, markersize=2.6, label=name)
