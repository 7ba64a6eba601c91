"""Figures of a calibration's statistics: correlation of unknowns, distribution of residuals, accuracy.

The accuracy of points is predicted over the measuring volume, and tested on held-out targets.
"""

from collections.abc import Mapping, Sequence
from statistics import NormalDist
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from grabberd.reports.figures.drawing import FAINT, INK, PALE, WIDTH_MM, Array, Svg, drawn
from grabberd.reports.notation import COLOURS, colour, fixed, symbol

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.contour import QuadContourSet
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


def distribution_svg(document: Mapping[str, Any], label: str) -> Svg:
    """Draw histogram and quantiles of the standardised residuals, x and y together, one colour per view."""
    samples = _samples(document["residuals"])

    def draw(canvas: "Figure") -> None:
        _histogram(canvas.add_axes((0.08, 0.20, 0.40, 0.70)), samples)
        _quantiles(canvas.add_axes((0.58, 0.20, 0.40, 0.70)), samples)

    return drawn(draw, 62.0, label)


def has_samples(residuals: Sequence[Mapping[str, Any]]) -> bool:
    """Return True if there are standardised residuals to draw."""
    return bool(_samples(residuals))


def _samples(residuals: Sequence[Mapping[str, Any]]) -> dict[str, Array]:
    samples: dict[str, list[float]] = {}
    for row in residuals:
        known = [row[axis] for axis in ("tau_x", "tau_y") if row.get(axis) is not None]
        samples.setdefault(row["view"], []).extend(known)
    return {view: np.array(values) for view, values in samples.items() if values}


def _histogram(axes: "Axes", samples: Mapping[str, Array]) -> None:
    values = np.concatenate(list(samples.values()))
    reach = max(4.0, float(np.ceil(np.abs(values).max() * 2) / 2))
    width = 0.5 if len(values) < 600 else 0.25
    edges = np.arange(-reach, reach + width / 2, width)
    axes.hist(
        list(samples.values()),
        bins=list(edges),
        stacked=True,
        color=[colour(view) for view in samples],
        label=list(samples),
        edgecolor="white",
        linewidth=0.25,
    )
    curve = np.linspace(-reach, reach, 121)
    density = np.exp(-0.5 * curve * curve) / np.sqrt(2 * np.pi) * len(values) * width
    axes.plot(curve, density, color=INK, label="normal")
    axes.set_xlim(-reach, reach)
    axes.set_xlabel("standardised residual τ")
    axes.set_ylabel("coordinates")
    axes.set_title("Histogram")
    axes.legend(loc="upper left", handlelength=1.2, borderaxespad=0.0)


def _quantiles(axes: "Axes", samples: Mapping[str, Array]) -> None:
    normal = NormalDist()
    reach = max(3.5, *(float(np.abs(values).max()) + 0.3 for values in samples.values()))
    axes.plot([-reach, reach], [-reach, reach], color=FAINT, linewidth=0.6)
    for view, values in samples.items():
        # Hazen's plotting positions: the first and the last stay finite.
        expected = [normal.inv_cdf((rank + 0.5) / len(values)) for rank in range(len(values))]
        axes.plot(expected, np.sort(values), "o", color=colour(view), markersize=2.2, mew=0, label=view)
    axes.set_xlim(-3.5, 3.5)
    axes.set_ylim(-reach, reach)
    axes.set_xlabel("expected of a normal distribution")
    axes.set_ylabel("observed")
    axes.set_title("Quantiles")
    axes.legend(loc="upper left", handlelength=1.0, borderaxespad=0.0)


Grid = np.ma.MaskedArray[tuple[int, ...], np.dtype[np.float64]]

_TOP_MM, _BOTTOM_MM, _GAP_MM = 6.0, 20.0, 4.0
_PANEL_MM = 45.0


def volume_svg(volume: Mapping[str, Any], share: str, label: str) -> Svg:
    """Draw σ of X, Y and Z: a row of panels for each plane, one scale per coordinate for all planes.

    Args:
        volume: the document's part.
        share: "calibration" or "total".
        label: alternative text.
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
                filled = _plane(axes, volume, grid, levels) or filled
                _label(axes, axis, plane["z_mm"], first=row == 0, last=row == len(planes) - 1)
            if filled is not None:
                bar = (_left(index), 6.0 / height_mm, _PANEL_MM / WIDTH_MM, 2.2 / height_mm)
                _scale(canvas, filled, bar)

    return drawn(draw, height_mm, label)


def validation_svg(points: Sequence[Mapping[str, Any]], label: str) -> Svg:
    """Draw the errors of held-out targets in X, Y and Z over their predicted σ, with the band of 1.96 σ."""

    def draw(canvas: "Figure") -> None:
        for index, axis in enumerate("xyz"):
            axes = canvas.add_axes((0.10 + 0.325 * index, 0.19, 0.235, 0.70))
            _errors(axes, axis, points)

    return drawn(draw, 66.0, label)


def _left(index: int) -> float:
    return 0.12 + 0.295 * index


def _grid(rows: list[list[float | None]]) -> Grid:
    return np.ma.masked_invalid(np.array(rows, dtype=np.float64))


def _levels(grids: Sequence[Grid]) -> Array:
    known = [grid.compressed() for grid in grids if grid.count()]
    if not known:
        return np.array([0.0, 1.0])
    values = np.concatenate(known)
    low, high = float(values.min()), float(values.max())
    # Levels have to rise, so an even σ gets a range of 2 %; the ends are moved out so that rounding leaves no
    # value outside of them.
    return np.linspace(low * 0.999, max(high, low * 1.02) * 1.001 + 1e-12, 9)


def _plane(axes: "Axes", volume: Mapping[str, Any], grid: Grid, levels: Array) -> "QuadContourSet | None":
    axes.set_xlim(volume["x_mm"][0], volume["x_mm"][-1])
    axes.set_ylim(volume["y_mm"][0], volume["y_mm"][-1])
    axes.set_facecolor("#f3f3f3")
    if min(grid.shape) < 2 or grid.count() < 3:
        return None
    return axes.contourf(volume["x_mm"], volume["y_mm"], grid.T, levels=levels, cmap="YlGnBu")


def _label(axes: "Axes", axis: str, z_mm: float, *, first: bool, last: bool) -> None:
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


def _errors(axes: "Axes", axis: str, points: Sequence[Mapping[str, Any]]) -> None:
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


Document = Mapping[str, Any]

_HATCH = "////"
_HEIGHT_MM = 176.0
_PAINTS = {"x": "#0072b2", "y": "#007a5a", "z": "#b34700"}
_SPREAD = 4.0
"""Greatest σ with a colour of its own, by the median inside of the volume: beyond it all are alike."""


def validity_svg(validity: Document, label: str) -> Svg:
    """Draw σ of points and of projections over both views, and σ of X, Y and Z over depth."""

    def draw(canvas: "Figure") -> None:
        views = validity["views"]
        for column, (key, title) in enumerate(
            (
                ("point_mm", "σ of a point, XYZ [mm]"),
                ("projection_px", "σ of the calibration in the picture [px]"),
            )
        ):
            for index, view in enumerate(views):
                left = (0.08 + 0.47 * column) + 0.19 * index
                axes = canvas.add_axes((left, 0.48, 0.17, 0.46))
                _picture(canvas, axes, view, sigma_lengths(view[key]), validity_colours(views, key))
                axes.set_title(f"{title}\n{view['view']}" if not index else view["view"])
                axes.tick_params(labelleft=not index)
                if not index:
                    axes.set_ylabel("frame line [px]")
        _depths(canvas.add_axes((0.08, 0.07, 0.88, 0.27)), validity["depths"])

    return drawn(draw, _HEIGHT_MM, label)


def sigma_lengths(grids: Mapping[str, Sequence[Sequence[float | None]]]) -> Array:
    """(rows, columns) σ of all axes together, NaN where one is not known."""
    squares = [np.array(grid, np.float64) ** 2 for grid in grids.values()]
    return np.sqrt(np.sum(squares, axis=0))


def validity_colours(views: Sequence[Document], key: str) -> Array:
    """Levels of colour that all views share: up to a multiple of what is usual in the volume."""
    every = [(sigma_lengths(view[key]), np.array(view["inside"], bool)) for view in views]
    known = np.concatenate([grid[np.isfinite(grid)] for grid, _ in every])
    within = np.concatenate([grid[np.isfinite(grid) & inside] for grid, inside in every])
    if not len(known):
        return np.array([0.0, 1.0])
    low = float(known.min())
    high = min(float(known.max()), _SPREAD * float(np.median(within if len(within) else known)))
    return np.linspace(low * 0.999, max(high, low * 1.02) * 1.001 + 1e-12, 9)


def _picture(canvas: "Figure", axes: "Axes", view: Document, grid: Array, levels: Array) -> None:
    columns, lines, inside = view["columns"], view["lines"], np.array(view["inside"], np.float64)
    axes.set_xlim(columns[0] - 0.5, columns[-1] + 0.5)
    axes.set_ylim(lines[-1] + 0.5, lines[0] - 0.5)
    axes.set_facecolor("#f3f3f3")
    axes.locator_params(nbins=4)
    axes.set_xlabel("column [px]")
    shown = np.ma.masked_invalid(grid)
    if shown.count() >= 3:
        filled = axes.contourf(columns, lines, shown, levels=levels, cmap="YlGnBu", extend="max")
        box = axes.get_position()
        scale = canvas.add_axes((box.x0, box.y0 - 0.065, box.width, 0.012))
        bar = canvas.colorbar(filled, cax=scale, orientation="horizontal", format="%.2g")
        bar.set_ticks([float(level) for level in levels[1::3]])
        bar.ax.tick_params(labelsize=6)
    axes.contourf(columns, lines, inside, levels=[-0.5, 0.5], colors="none", hatches=[_HATCH])
    axes.contour(columns, lines, inside, levels=[0.5], colors=[FAINT], linewidths=0.7)


def _depths(axes: "Axes", depths: Document) -> None:
    z, inside = np.array(depths["z_mm"], np.float64), np.array(depths["inside"], bool)
    for axis, paint in _PAINTS.items():
        for share, line in (("total", "-"), ("calibration", (0, (4, 2)))):
            values = np.array(depths[share][axis], np.float64)
            axes.plot(z, values, color=paint, linestyle=line, label=f"{axis.upper()}, {share}")
    axes.set_xlim(z[0], z[-1])
    axes.set_ylim(0.0, 1.2 * axes.get_ylim()[1])
    if inside.any():
        for first, last in ((z[0], z[inside][0]), (z[inside][-1], z[-1])):
            axes.axvspan(first, last, facecolor="none", edgecolor=FAINT, hatch=_HATCH, linewidth=0)
    axes.set_xlabel("Z [mm]")
    axes.set_ylabel("σ [mm]")
    axes.set_title("σ over the volume's depth")
    axes.legend(loc="upper center", ncols=6, handlelength=2.0, frameon=True, edgecolor="none", framealpha=1.0)
