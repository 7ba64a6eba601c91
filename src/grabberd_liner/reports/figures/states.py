"""The wall in chosen states side by side: as a body, and as maps on the target grid (paper figure 11)."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Indices
from grabberd.reports.figures.drawing import FAINT, GREY, INK, WIDTH_MM, Svg, drawn
from grabberd_liner.reports.columns import Columns

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

Draw = Callable[["Axes", Sequence["State"]], "ScalarMappable | None"]

_TOP_MM, _BOTTOM_MM, _GAP_MM = 7.0, 9.0, 5.0
_LEFT_MM, _RIGHT_MM = 12.0, 19.0
_BODY_MM, _MAP_MM = 76.0, 62.0
_TURNED, _TILTED = np.deg2rad(48.0), np.deg2rad(16.0)
_LIGHT = np.array([-0.35, -0.35, 0.87])
_BARE = np.array([0.80, 0.87, 0.96])
"""The wall's colour where nothing is determined."""
_TICKS = 8
_APART = 2.2
"""Columns from the last one of a state's map to the first one of the next."""


class State(NamedTuple):
    """A state of the wall: columns of its T targets in the grid's order, (K, 3) indices of triangles."""

    name: str
    columns: Columns
    triangles: Indices

    @property
    def xyz_mm(self) -> Array:
        """(T, 3) positions of the targets."""
        return np.column_stack([self.columns.numbers(f"{axis}_mm") for axis in "xyz"])


class Scale(NamedTuple):
    """The colour scale of a quantity, the same in all states."""

    levels: Array
    colours: str

    @classmethod
    def of(cls, values: Array) -> "Scale":
        """Choose a sequential scale, or one centred on zero if values of both signs matter."""
        from matplotlib.ticker import MaxNLocator  # noqa: PLC0415

        known = values[np.isfinite(values)]
        low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
        if low < -0.1 * max(high, 0.0):
            reach = max(-low, high)
            return cls(np.asarray(MaxNLocator(11).tick_values(-reach, reach)), "RdBu_r")
        # The levels of a quantity that is the same everywhere would differ by rounding alone.
        high = max(high, low + max(0.02 * abs(low), 1e-12))
        return cls(np.asarray(MaxNLocator(9).tick_values(low, high)), "YlOrRd")

    def painted(self, values: Array) -> Array:
        """(K, 3) colours of known values, in the same steps as in the maps."""
        from matplotlib import colormaps  # noqa: PLC0415

        middles = (self.levels[1:] + self.levels[:-1]) / 2
        chosen = middles[np.clip(np.searchsorted(self.levels, values) - 1, 0, len(middles) - 1)]
        span = self.levels[-1] - self.levels[0]
        return np.asarray(colormaps[self.colours]((chosen - self.levels[0]) / span))[:, :3]


def states_of(document: Mapping[str, Any]) -> list[State]:
    """Read the states from a document."""
    triangles = np.array(document["grid"]["triangles"], np.intp).reshape(-1, 3)
    return [State(one["name"], Columns(one["targets"]), triangles) for one in document["states"]]


def model_svg(states: Sequence[State], column: str, title: str, label: str) -> Svg:
    """Draw the model above and a map below, the states side by side (paper figure 11)."""
    scale = Scale.of(_all(states, column))
    rows = [
        _Row(_BODY_MM, lambda axes, shown: _bodies(axes, shown, column, scale), None),
        _map_row(column, states[0].columns.titled(column, title), scale),
    ]
    return _svg(states, rows, label)


def maps_svg(states: Sequence[State], column: str, title: str, label: str) -> Svg:
    """Draw maps of a quantity above and of its σ below, the states side by side."""
    rows = [
        _map_row(name, states[0].columns.titled(name, text), Scale.of(_all(states, name)))
        for name, text in ((column, title), (f"sigma_{column}", f"σ of {title}"))
    ]
    return _svg(states, rows, label)


class _Row(NamedTuple):
    """A row of panels that share one pair of axes, with the title of the colour bar at its end, if any."""

    height_mm: float
    draw: Draw
    bar: str | None


def _map_row(column: str, bar: str, scale: Scale) -> _Row:
    return _Row(_MAP_MM, lambda axes, states: _maps(axes, states, column, scale), bar)


def _svg(states: Sequence[State], rows: Sequence[_Row], label: str) -> Svg:
    height_mm = _TOP_MM + _BOTTOM_MM + sum(row.height_mm for row in rows) + _GAP_MM * (len(rows) - 1)

    def draw(canvas: "Figure") -> None:
        top = height_mm - _TOP_MM
        for row in rows:
            axes = _draw_row(canvas, states, row, top, height_mm)
            top -= row.height_mm + _GAP_MM
        _number_columns(axes, states)
        for index, state in enumerate(states):
            middle_mm = _LEFT_MM + (index + 0.5) * _step_mm(states)
            position = middle_mm / WIDTH_MM, 1 - 0.5 * _TOP_MM / height_mm
            canvas.text(*position, state.name, ha="center", va="center", size=8, weight="bold")

    return drawn(draw, height_mm, label)


def _step_mm(states: Sequence[State]) -> float:
    return (WIDTH_MM - _LEFT_MM - _RIGHT_MM) / len(states)


def _draw_row(
    canvas: "Figure", states: Sequence[State], row: _Row, top_mm: float, height_mm: float
) -> "Axes":
    bottom = (top_mm - row.height_mm) / height_mm
    width = (WIDTH_MM - _LEFT_MM - _RIGHT_MM) / WIDTH_MM
    axes = canvas.add_axes((_LEFT_MM / WIDTH_MM, bottom, width, row.height_mm / height_mm))
    filled = row.draw(axes, states)
    if row.bar is not None and filled is not None:
        left = 1 - (_RIGHT_MM - 2) / WIDTH_MM
        box = (left, bottom + 6 / height_mm, 2.4 / WIDTH_MM, 0.8 * row.height_mm / height_mm)
        bar: Any = canvas.colorbar(filled, cax=canvas.add_axes(box))
        bar.outline.set_visible(False)
        bar.set_label(row.bar)
    return axes


def _all(states: Sequence[State], column: str) -> Array:
    return np.concatenate([state.columns.numbers(column) for state in states])


def _seen(xyz_mm: Array) -> Array:
    """(N, 3) coordinates to the right, down and towards a viewer beside and a little above the wall."""
    x, y, z = np.moveaxis(xyz_mm, -1, 0)
    right, near = y * np.cos(_TURNED) + z * np.sin(_TURNED), z * np.cos(_TURNED) - y * np.sin(_TURNED)
    return np.stack(
        [right, x * np.cos(_TILTED) + near * np.sin(_TILTED), near * np.cos(_TILTED) - x * np.sin(_TILTED)],
        axis=-1,
    )


def _bodies(axes: "Axes", states: Sequence[State], column: str, scale: Scale) -> None:
    """Triangles in the colours of the map, shaded by their slope; the farthest are drawn first."""
    from matplotlib.collections import PolyCollection  # noqa: PLC0415

    seen = [_seen(state.xyz_mm) for state in states]
    low, high = np.nanmin(seen, axis=(0, 1)) - 2, np.nanmax(seen, axis=(0, 1)) + 2
    step = _step_mm(states) * (high[1] - low[1]) / _BODY_MM
    for index, (state, points) in enumerate(zip(states, seen, strict=True)):
        corners = points[state.triangles] - [(low[0] + high[0]) / 2 - (index + 0.5) * step, 0, 0]
        values = state.columns.numbers(column)[state.triangles].mean(axis=1)
        order = np.argsort(corners[:, :, 2].mean(axis=1))
        order = order[np.isfinite(corners[order]).all(axis=(1, 2))]
        faces = PolyCollection(
            list(corners[order, :, :2]),
            facecolors=_lit(corners[order], values[order], scale),
            edgecolors=INK,
            linewidths=0.25,
            clip_on=False,
        )
        axes.add_collection(faces, autolim=False)
    axes.set_xlim(0, len(states) * step)
    axes.set_ylim(high[1], low[1])
    axes.set_axis_off()


def _lit(corners: Array, values: Array, scale: Scale) -> Array:
    """(K, 3) colours of shaded triangles."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    light = 0.66 + 0.42 * np.abs(normal @ _LIGHT)
    colours = np.tile(_BARE, (len(values), 1))
    known = np.isfinite(values)
    colours[known] = scale.painted(values[known])
    return np.clip(light[:, np.newaxis] * colours, 0, 1)


def _maps(axes: "Axes", states: Sequence[State], column: str, scale: Scale) -> "ScalarMappable | None":
    """Maps with rows down and columns to the right, as in the picture; crosses mark unknown values."""
    down = _all(states, "row")
    across = np.concatenate([state.columns.numbers("column") + k for state, k in _with_offsets(states)])
    values = _all(states, column)
    known = np.isfinite(values)
    axes.plot(across[~known], down[~known], "x", color=GREY, markersize=2.2, mew=0.4)
    filled = _filled(axes, states, (across, down, values), scale)
    axes.plot(across[known], down[known], ".", color=INK, markersize=1.2, mew=0)
    axes.set_xlim(across.min() - _APART / 2, across.max() + _APART / 2)
    axes.set_ylim(down.max() + 0.5, down.min() - 0.5)
    axes.locator_params(axis="y", integer=True, nbins=6)
    axes.set_xticks([])
    axes.set_ylabel("row")
    axes.spines[["left", "bottom"]].set_visible(False)
    return filled


def _with_offsets(states: Sequence[State]) -> Iterator[tuple[State, float]]:
    """The states, each with the offset of its columns that puts it beside the one before."""
    step = np.ptp(states[0].columns.numbers("column")) + _APART
    return ((state, k * step) for k, state in enumerate(states))


def _number_columns(axes: "Axes", states: Sequence[State]) -> None:
    """Column numbers under the lowest row; they hold for the rows above it as well."""
    own = states[0].columns.numbers("column")
    shown = np.arange(own.min(), own.max() + 1, np.ceil((np.ptp(own) + 1) / _TICKS))
    ticks = [(column + k, f"{column:.0f}") for _, k in _with_offsets(states) for column in shown]
    axes.set_xticks(*zip(*ticks, strict=True))
    axes.tick_params(color=FAINT)
    axes.set_xlabel("column")


def _filled(
    axes: "Axes", states: Sequence[State], columns: tuple[Array, Array, Array], scale: Scale
) -> "ScalarMappable | None":
    from matplotlib.tri import Triangulation  # noqa: PLC0415

    across, down, values = columns
    count = len(values) // len(states)
    triangles = np.concatenate([state.triangles + k * count for k, state in enumerate(states)])
    use = triangles[np.isfinite(values)[triangles].all(axis=1)]
    if not len(use):
        return None
    mesh = Triangulation(across, down, use)
    return axes.tricontourf(mesh, np.nan_to_num(values), levels=scale.levels, cmap=scale.colours)
