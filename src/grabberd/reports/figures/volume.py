"""How well a point is determined, over the measuring volume."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from grabberd.reports.figures.drawing import WIDTH_MM, drawn
from grabberd.reports.figures.picture import Array
from grabberd.reports.markup import Html
from grabberd.reports.numbers import fixed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.contour import QuadContourSet
    from matplotlib.figure import Figure

_TOP_MM, _BOTTOM_MM, _GAP_MM = 6.0, 20.0, 4.0
_PANEL_MM = 45.0


def volume_svg(volume: Mapping[str, Any], share: str, label: str) -> Html:
    """A row of panels for each plane, one for X, Y and Z, each coordinate with one scale for all planes.

    Args:
        volume: the document's part.
        share: "calibration" or "total".
        label: of the figure.
    """
    planes = volume["planes"]
    long, short = volume["x_mm"], volume["y_mm"]
    panel_mm = min(max(_PANEL_MM * (short[-1] - short[0]) / (long[-1] - long[0]), 12.0), _PANEL_MM)
    height_mm = _TOP_MM + _BOTTOM_MM + len(planes) * (panel_mm + _GAP_MM)

    def draw(canvas: "Figure") -> None:
        for index, axis in enumerate("xyz"):
            grids = [_grid(plane[share][axis]) for plane in planes]
            levels = _levels(grids)
            filled = None
            for row, (plane, grid) in enumerate(zip(planes, grids, strict=True)):
                bottom = height_mm - _TOP_MM - (row + 1) * panel_mm - row * _GAP_MM
                box = (_left(index), bottom / height_mm, _PANEL_MM / WIDTH_MM, panel_mm / height_mm)
                axes = canvas.add_axes(box)
                filled = _panel(axes, volume, grid, levels) or filled
                _say(axes, axis, plane["z_mm"], first=row == 0, last=row == len(planes) - 1)
            if filled is not None:
                bar = (_left(index), 6.0 / height_mm, _PANEL_MM / WIDTH_MM, 2.2 / height_mm)
                _scale(canvas, filled, bar)

    return drawn(draw, height_mm, label)


def _left(index: int) -> float:
    return 0.12 + 0.295 * index


def _grid(rows: list[list[float | None]]) -> "np.ma.MaskedArray[tuple[int, ...], np.dtype[np.float64]]":
    return np.ma.masked_invalid(np.array(rows, dtype=np.float64))


def _levels(grids: "list[np.ma.MaskedArray[tuple[int, ...], np.dtype[np.float64]]]") -> Array:
    known = [grid.compressed() for grid in grids if grid.count()]
    if not known:
        return np.array([0.0, 1.0])
    values = np.concatenate(known)
    low, high = float(values.min()), float(values.max())
    return np.linspace(low * 0.999, max(high, low * 1.02) * 1.001 + 1e-12, 9)


def _panel(
    axes: "Axes",
    volume: Mapping[str, Any],
    grid: "np.ma.MaskedArray[tuple[int, ...], np.dtype[np.float64]]",
    levels: Array,
) -> "QuadContourSet | None":
    axes.set_xlim(volume["x_mm"][0], volume["x_mm"][-1])
    axes.set_ylim(volume["y_mm"][0], volume["y_mm"][-1])
    axes.set_facecolor("#f3f3f3")
    if min(grid.shape) < 2 or grid.count() < 3:
        return None
    return axes.contourf(volume["x_mm"], volume["y_mm"], grid.T, levels=levels, cmap="YlGnBu")


def _say(axes: "Axes", axis: str, z_mm: float, *, first: bool, last: bool) -> None:
    axes.tick_params(labelbottom=last, labelleft=axis == "x")
    axes.locator_params(nbins=5)
    if first:
        axes.set_title(f"σ of {axis.upper()} [mm]")
    if last:
        axes.set_xlabel("X [mm]")
    if axis == "x":
        axes.set_ylabel(f"Z = {fixed(z_mm, 1)} mm\nY [mm]")


def _scale(canvas: "Figure", filled: "QuadContourSet", box: tuple[float, float, float, float]) -> None:
    bar = canvas.colorbar(filled, cax=canvas.add_axes(box), orientation="horizontal", format="%.2g")
    bar.set_ticks([float(level) for level in np.asarray(filled.levels)[1::3]])
