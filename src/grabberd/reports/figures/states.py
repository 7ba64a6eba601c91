"""The wall in chosen states side by side: as a body, and as maps on the target grid (paper figure 11)."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.reports.columns import Array, Columns
from grabberd.reports.figures.drawing import FAINT, GREY, INK, WIDTH_MM, drawn
from grabberd.reports.markup import Html

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Draw = Callable[["Axes", "State", bool], object]

_TOP_MM, _BOTTOM_MM, _GAP_MM = 7.0, 9.0, 6.0
_LEFT_MM, _RIGHT_MM = 12.0, 19.0
_BODY_MM, _MAP_MM = 58.0, 62.0
_TURNED, _TILTED = np.deg2rad(38.0), np.deg2rad(18.0)
_LIGHT = np.array([-0.35, -0.35, 0.87])


class State(NamedTuple):
    """One of the document's states: T targets in the grid's order, and (K, 3) triangles of their places."""

    name: str
    columns: Columns
    triangles: NDArray[np.intp]

    @property
    def xyz_mm(self) -> Array:
        """(T, 3)."""
        return np.column_stack([self.columns.numbers(f"{axis}_mm") for axis in "xyz"])


class Scale(NamedTuple):
    """The colours of a quantity, the same in all states."""

    levels: Array
    colours: str

    @classmethod
    def of(cls, values: Array) -> "Scale":
        """Sequential, or about zero where values of both signs count."""
        from matplotlib.ticker import MaxNLocator  # noqa: PLC0415

        known = values[np.isfinite(values)]
        low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
        if low < -0.1 * max(high, 0.0):
            reach = max(-low, high)
            return cls(np.asarray(MaxNLocator(11).tick_values(-reach, reach)), "RdBu_r")
        return cls(np.asarray(MaxNLocator(9).tick_values(low, max(high, low + 1e-12))), "YlOrRd")


def states_of(document: Mapping[str, Any]) -> list[State]:
    """The document's states, ready to be drawn."""
    triangles = np.array(document["grid"]["triangles"], np.intp).reshape(-1, 3)
    return [State(one["name"], Columns(one["targets"]), triangles) for one in document["states"]]


def model_svg(states: Sequence[State], column: str, title: str, label: str) -> Html:
    """The model above, a map below; every state beside the next (paper figure 11)."""
    scale = Scale.of(np.concatenate([state.columns.numbers(column) for state in states]))
    limits = _limits(states)
    rows = [
        _Row(_BODY_MM, lambda axes, state, _: _body(axes, state, limits), None),
        _map_row(column, states[0].columns.titled(column, title), scale),
    ]
    return _svg(states, rows, label)


def maps_svg(states: Sequence[State], column: str, title: str, label: str) -> Html:
    """A map of a quantity, and of its σ below."""
    rows = [
        _map_row(name, states[0].columns.titled(name, said), Scale.of(_all(states, name)))
        for name, said in ((column, title), (f"sigma_{column}", f"σ of {title}"))
    ]
    return _svg(states, rows, label)


class _Row(NamedTuple):
    """A row of panels, and the colour bar at its end."""

    height_mm: float
    draw: Draw
    bar: str | None


def _map_row(column: str, bar: str, scale: Scale) -> _Row:
    return _Row(_MAP_MM, lambda axes, state, first: _map(axes, state, column, scale, first), bar)


def _svg(states: Sequence[State], rows: Sequence[_Row], label: str) -> Html:
    height_mm = _TOP_MM + _BOTTOM_MM + sum(row.height_mm for row in rows) + _GAP_MM * (len(rows) - 1)

    def draw(canvas: "Figure") -> None:
        top = height_mm - _TOP_MM
        for index, row in enumerate(rows):
            _draw_row(canvas, states, row, top, height_mm, title=index == 0)
            top -= row.height_mm + _GAP_MM

    return drawn(draw, height_mm, label)


def _draw_row(
    canvas: "Figure", states: Sequence[State], row: _Row, top: float, height_mm: float, *, title: bool
) -> None:
    step = (WIDTH_MM - _LEFT_MM - _RIGHT_MM) / len(states)
    filled = None
    bottom = (top - row.height_mm) / height_mm
    for index, state in enumerate(states):
        left = (_LEFT_MM + index * step) / WIDTH_MM
        axes = canvas.add_axes((left, bottom, 0.92 * step / WIDTH_MM, row.height_mm / height_mm))
        filled = row.draw(axes, state, index == 0) or filled
        if title:
            axes.set_title(state.name, loc="center")
    if row.bar is not None and filled is not None:
        box = (
            1 - (_RIGHT_MM - 2) / WIDTH_MM,
            bottom + 6 / height_mm,
            2.4 / WIDTH_MM,
            0.8 * row.height_mm / height_mm,
        )
        bar: Any = canvas.colorbar(filled, cax=canvas.add_axes(box))  # type: ignore[arg-type]
        bar.outline.set_visible(False)
        bar.set_label(row.bar)


def _all(states: Sequence[State], column: str) -> Array:
    return np.concatenate([state.columns.numbers(column) for state in states])


def _seen(xyz_mm: Array) -> Array:
    """(N, 3) to the right, down and towards the onlooker, from beside and a little above."""
    x, y, z = np.moveaxis(xyz_mm, -1, 0)
    right, near = y * np.cos(_TURNED) + z * np.sin(_TURNED), z * np.cos(_TURNED) - y * np.sin(_TURNED)
    return np.stack(
        [right, x * np.cos(_TILTED) + near * np.sin(_TILTED), near * np.cos(_TILTED) - x * np.sin(_TILTED)],
        axis=-1,
    )


def _limits(states: Sequence[State]) -> tuple[Array, Array]:
    seen = np.concatenate([_seen(state.xyz_mm) for state in states])
    return np.nanmin(seen, axis=0) - 2, np.nanmax(seen, axis=0) + 2


def _body(axes: "Axes", state: State, limits: tuple[Array, Array]) -> None:
    """Triangles, the farthest first, as bright as the light falls on them."""
    from matplotlib.collections import PolyCollection  # noqa: PLC0415

    corners = _seen(state.xyz_mm)[state.triangles]
    corners = corners[np.isfinite(corners).all(axis=(1, 2))]
    corners = corners[np.argsort(corners[:, :, 2].mean(axis=1))]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    bright = (0.45 + 0.5 * np.abs(normal @ _LIGHT))[:, np.newaxis] * np.array([0.80, 0.87, 0.96])
    axes.add_collection(
        PolyCollection(
            list(corners[:, :, :2]), facecolors=np.clip(bright, 0, 1), edgecolors=INK, linewidths=0.25
        )
    )
    axes.set_xlim(limits[0][0], limits[1][0])
    axes.set_ylim(limits[1][1], limits[0][1])
    axes.set_aspect("equal")
    axes.set_axis_off()


def _map(axes: "Axes", state: State, column: str, scale: Scale, first: bool) -> object:
    """Rows down, columns to the right, as the picture has them; a cross where nothing is determined."""
    from matplotlib.tri import Triangulation  # noqa: PLC0415

    across, down = state.columns.numbers("column"), state.columns.numbers("row")
    values = state.columns.numbers(column)
    known = np.isfinite(values)
    use = state.triangles[known[state.triangles].all(axis=1)]
    filled = None
    if len(use):
        filled = axes.tricontourf(
            Triangulation(across, down, use),
            np.where(known, values, 0.0),
            levels=scale.levels,
            cmap=scale.colours,
        )
    axes.plot(across[known], down[known], ".", color=INK, markersize=1.2, mew=0)
    axes.plot(across[~known], down[~known], "x", color=GREY, markersize=2.2, mew=0.4)
    axes.set_xlim(across.min() - 0.5, across.max() + 0.5)
    axes.set_ylim(down.max() + 0.5, down.min() - 0.5)
    axes.set_aspect("equal")
    axes.locator_params(integer=True, nbins=6)
    axes.set_xlabel("column")
    axes.tick_params(labelleft=first, color=FAINT)
    if first:
        axes.set_ylabel("row")
    return filled
