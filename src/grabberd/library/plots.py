"""Pictures of captures and analyses, drawn into matplotlib's axes."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import NotFound
from grabberd.library.fields import CapturedField
from grabberd.library.tables import PointTable, Table, optional

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def _axes(given: "Axes | None", **options: Any) -> "Axes":
    if given is not None:
        return given
    pyplot = optional("matplotlib.pyplot", "a plot")
    _, made = pyplot.subplots(layout="constrained", **options)
    return made


def draw_field(field: CapturedField, ax: "Axes | None" = None) -> "Axes":
    """Draws a field in frame pixels."""
    axes = _axes(ax, figsize=(8, 6))
    first, last, step = field.lines[0], field.lines[-1], field.packed.y_step
    extent = (-0.5, field.packed.columns - 0.5, last + step / 2, first - step / 2)
    axes.imshow(field.picture, cmap="gray", vmin=0, vmax=255, extent=extent)
    axes.set(title=f"field {field.n}, {field.time_s:.2f} s", xlabel="x, px", ylabel="y, frame lines")
    return axes


def draw_points(points: PointTable, ax: "Axes | None" = None) -> "Axes":
    """Draws points in the object's frame as seen along z; the colour is z."""
    wide, high = np.ptp(points["x_mm"]), np.ptp(points["y_mm"])
    # As wide as a notebook's page, and as high as the object with its labels.
    axes = _axes(ax, figsize=(8, min(max(8 * high / max(wide, 1.0), 1.5), 8) + 1))
    drawn = axes.scatter(points["x_mm"], points["y_mm"], c=points["z_mm"], s=14)
    bar = axes.figure.colorbar(drawn, ax=axes)
    bar.set_label("z, mm")
    axes.set(xlabel="x, mm", ylabel="y, mm", aspect="equal", title=f"{len(points)} points")
    return axes


def draw_target(points: PointTable, target: int, axis: str, ax: "Axes | None" = None) -> "Axes":
    """Draws a coordinate of a target over time, with its σ."""
    name = f"{axis}_mm"
    value, sigma, chosen = points[name], points[f"sigma_{name}"], points["target"] == target
    if not chosen.any():
        known = ", ".join(map(str, points.targets.target))
        raise NotFound(f"target {target} was found in no field", f"the targets are {known}")
    axes = _axes(ax, figsize=(9, 3.5))
    axes.errorbar(points["time_s"][chosen], value[chosen], sigma[chosen], fmt=".-", elinewidth=1)
    axes.set(xlabel="time, s", ylabel=f"{axis}, mm", title=f"target {target}")
    return axes


def draw_courses(table: Table, time: str, columns: Sequence[str], ax: "Axes | None" = None) -> "Axes":
    """Draws columns of a table over its time, with their σ where they have one."""
    axes = _axes(ax, figsize=(9, 3.5))
    for name in columns:
        sigma = table[f"sigma_{name}"] if f"sigma_{name}" in table.units else None
        axes.errorbar(table[time], table[name], sigma, fmt=".-", elinewidth=1, label=name)
    units = sorted({table.units[name] for name in columns} - {""})
    axes.set(xlabel="time, s", ylabel=", ".join(units))
    axes.legend()
    return axes


def draw_map(values: NDArray[np.float64], title: str, unit: str, ax: "Axes | None" = None) -> "Axes":
    """Draws values over the targets' grid, the rows of the object along x."""
    axes = _axes(ax, figsize=(8, 3))
    axes.set_facecolor("lightgray")
    drawn = axes.imshow(values.T, aspect="auto")
    bar = axes.figure.colorbar(drawn, ax=axes)
    bar.set_label(unit)
    axes.set(title=title, xlabel="row", ylabel="column")
    return axes
