"""The imaging geometry to scale, from above and from the side (paper figure 7)."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from grabberd.reports.figures.drawing import FAINT, INK, WIDTH_MM, Array, Svg, drawn
from grabberd.reports.notation import colour, significant

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SCALES = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 7.5, 10.0, 15.0, 20.0, 25.0, 50.0, 100.0, 200.0, 500.0, 1000.0)
"""k of the scales 1 : k that drawings have; the first that fits is taken."""
_ROOM_MM = (WIDTH_MM - 12.0, 150.0)
_MARGIN = 0.07
_PAPER = {"facecolor": "white", "edgecolor": "none", "pad": 1.2, "alpha": 0.85}
"""Behind lettering, so that the rays do not cross it out."""


class _Scene(NamedTuple):
    """The rig in axes of its base: along the base, across, towards the cameras; (…, 3) in mm.

    Attributes:
        turn: (3, 3) rotation from the object's frame into these axes.
        targets: (T, 3) targets.
        centers: (V, 3) projection centres.
        middle: (3,) mean of the targets.
    """

    turn: Array
    targets: Array
    centers: Array
    middle: Array


def geometry_svg(geometry: Mapping[str, Any], label: str) -> tuple[Svg, float]:
    """Draw the rig from above and from the side; the second result is k of the scale 1 : k on paper."""
    scene = _scene(geometry)
    top, side = _box(scene, geometry, 0), _box(scene, geometry, 1)
    scale = _fit_scale(top, side)
    height_mm = float(top[3] - top[2]) / scale

    def draw(canvas: "Figure") -> None:
        above = _panel(canvas, top, 0.0, scale, height_mm)
        beside = _panel(canvas, side, WIDTH_MM - (side[1] - side[0]) / scale, scale, height_mm)
        _view(above, scene, geometry, 0)
        _view(beside, scene, geometry, 1)
        _names(above, scene, geometry)
        _name(beside, scene.centers.mean(axis=0)[1:], " and ".join(_named(geometry)), INK)
        _dimensions(above, scene, geometry)
        for axes, title in ((above, "From above"), (beside, "From the side")):
            axes.text(0.0, 1.0, title, transform=axes.transAxes, weight="bold", va="top", size=8)

    return drawn(draw, height_mm, label), scale


def _scene(geometry: Mapping[str, Any]) -> _Scene:
    centers = np.array([camera["center_mm"] for camera in geometry["cameras"]], dtype=np.float64)
    targets = np.array(geometry["targets_mm"], dtype=np.float64).reshape(-1, 3)
    middle = targets.mean(axis=0)
    base = centers[-1] - centers[0] if len(centers) > 1 else np.array([1.0, 0.0, 0.0])
    base = base / np.linalg.norm(base)
    depth = centers.mean(axis=0) - middle
    depth = depth - (depth @ base) * base
    depth = depth / np.linalg.norm(depth)
    turn = np.array([base, np.cross(base, depth), depth])
    return _Scene(turn, targets @ turn.T, centers @ turn.T, turn @ middle)


def _box(scene: _Scene, geometry: Mapping[str, Any], across: int) -> Array:
    """Left, right, bottom and top of a panel, in mm on the object."""
    shown = np.concatenate([scene.targets, scene.centers, *_footprints(scene, geometry)])[:, [across, 2]]
    low, high = shown.min(axis=0), shown.max(axis=0)
    room = _MARGIN * float((high - low).max())
    everything = np.concatenate([scene.targets[:, 2], scene.centers[:, 2]])
    return np.array(
        [low[0] - room, high[0] + room, everything.min() - 2.6 * room, everything.max() + 1.9 * room]
    )


def _fit_scale(top: Array, side: Array) -> float:
    wide = float(top[1] - top[0] + side[1] - side[0])
    needed = max(wide / _ROOM_MM[0], float(top[3] - top[2]) / _ROOM_MM[1])
    return next((scale for scale in _SCALES if scale >= needed), needed)


def _panel(canvas: "Figure", box: Array, left_mm: float, scale: float, height_mm: float) -> "Axes":
    width = float(box[1] - box[0]) / scale
    axes = canvas.add_axes((left_mm / WIDTH_MM, 0.0, width / WIDTH_MM, (box[3] - box[2]) / scale / height_mm))
    axes.set_xlim(box[0], box[1])
    axes.set_ylim(box[2], box[3])
    axes.set_axis_off()
    return axes


def _footprints(scene: _Scene, geometry: Mapping[str, Any]) -> list[Array]:
    """(4, 3) for each camera: where the rays of its corners reach the depth of the targets' centre."""
    found = []
    for camera, center in zip(geometry["cameras"], scene.centers, strict=True):
        rays = np.array(camera["corners"], dtype=np.float64) @ scene.turn.T
        # A ray that leads away from the object would meet this depth only behind the camera.
        reach = (scene.middle[2] - center[2]) / np.where(rays[:, 2] < 0, rays[:, 2], -1.0)
        found.append(center + rays * reach[:, np.newaxis])
    return found


def _view(axes: "Axes", scene: _Scene, geometry: Mapping[str, Any], across: int) -> None:
    flat = [across, 2]
    cameras: Sequence[Mapping[str, Any]] = geometry["cameras"]
    feet = _footprints(scene, geometry)
    for camera, center, foot in zip(cameras, scene.centers, feet, strict=True):
        paint = colour(camera["name"], [one["name"] for one in cameras])
        edge = foot[:, across]
        outline = np.array([center[flat], foot[edge.argmin()][flat], foot[edge.argmax()][flat]])
        axes.fill(*outline.T, color=paint, alpha=0.10, linewidth=0)
        axes.plot(*_rays(center[flat], scene.targets[:, flat]), color=paint, alpha=0.28, linewidth=0.25)
        _camera(axes, center[flat], outline[1:], paint)
        axis = scene.turn @ np.array(camera["axis"], dtype=np.float64)
        end = center + axis * 0.42 * np.linalg.norm(center - scene.middle)
        axes.plot(
            *zip(center[flat], end[flat], strict=True),
            color=paint,
            linewidth=0.7,
            linestyle=(0, (6, 2, 1, 2)),
        )
    axes.plot(*scene.targets[:, flat].T, "o", color=INK, markersize=1.8, mew=0)
    _object_axes(axes, scene, flat)


def _named(geometry: Mapping[str, Any]) -> list[str]:
    return [camera["name"] for camera in geometry["cameras"]]


def _names(axes: "Axes", scene: _Scene, geometry: Mapping[str, Any]) -> None:
    for name, center in zip(_named(geometry), scene.centers, strict=True):
        _name(axes, center[[0, 2]], name, colour(name, _named(geometry)))


def _name(axes: "Axes", position: Array, name: str, paint: str) -> None:
    axes.annotate(
        name, _pair(position), (0, 6), textcoords="offset points", color=paint, weight="bold", ha="center"
    )


def _rays(center: Array, targets: Array) -> Array:
    """(2, 3 T) one line, interrupted by NaN, from the centre to every target."""
    ends = np.stack([np.broadcast_to(center, targets.shape), targets, np.full(targets.shape, np.nan)], axis=1)
    return ends.reshape(-1, 2).T


def _camera(axes: "Axes", center: Array, feet: Array, paint: str) -> None:
    """The projection centre and the first part of the rays that bound its picture."""
    axes.plot(*center, "o", color=paint, markersize=4, mec="white", mew=0.5, zorder=4)
    near = center + 0.16 * (feet - center)
    axes.plot(*np.array([near[0], center, near[1], near[0]]).T, color=paint, linewidth=0.9)


def _object_axes(axes: "Axes", scene: _Scene, flat: list[int]) -> None:
    """The directions of the object's axes, in a corner, without the one that points at the reader."""
    length = 0.08 * float(np.linalg.norm(scene.centers.mean(axis=0) - scene.middle))
    corner = np.array([axes.get_xlim()[0], axes.get_ylim()[0]]) + 0.4 * length
    arrow = {"arrowstyle": "->", "color": INK, "linewidth": 0.7, "shrinkA": 0, "shrinkB": 0}
    for name, direction in zip("XYZ", scene.turn.T[:, flat], strict=True):
        if np.linalg.norm(direction) > 0.5:
            axes.annotate("", _pair(corner + direction * length), xytext=_pair(corner), arrowprops=arrow)
            tip = _pair(corner + direction * length * 1.3)
            axes.annotate(name, tip, ha="center", va="center", style="italic")


def _meeting(scene: _Scene, geometry: Mapping[str, Any]) -> Array | None:
    """Point seen from above where the central rays of both halves meet; None if not in front of the base."""
    first, last = scene.centers[0][[0, 2]], scene.centers[-1][[0, 2]]
    rays = [np.mean(camera["corners"], axis=0) @ scene.turn.T for camera in geometry["cameras"]]
    directions = np.stack([rays[0][[0, 2]], -rays[-1][[0, 2]]], axis=1)
    if abs(np.linalg.det(directions)) < 1e-3:
        return None
    along = np.linalg.solve(directions, last - first)
    meeting: Array = first + along[0] * directions[:, 0]
    return None if (along <= 0).any() else meeting


def _pair(position: Array) -> tuple[float, float]:
    return float(position[0]), float(position[1])


def _dimensions(axes: "Axes", scene: _Scene, geometry: Mapping[str, Any]) -> None:
    first, last, middle = scene.centers[0][[0, 2]], scene.centers[-1][[0, 2]], scene.middle[[0, 2]]
    if (base := geometry.get("base_mm")) is not None:
        _dimension(axes, first, last, f"base {significant(base, 5)} mm")
    if (distance := geometry.get("distance_mm")) is not None:
        _dimension(axes, middle, (first + last) / 2, f"distance {significant(distance, 5)} mm", share=0.68)
    if (convergence := geometry.get("convergence_deg")) is not None:
        meeting = _meeting(scene, geometry)
        if meeting is not None:
            _angle(axes, meeting, (first, last), f"{significant(convergence, 4)}°")
    axes.plot(*middle, "+", color=FAINT, markersize=5, mew=0.6)


def _dimension(axes: "Axes", start: Array, end: Array, text: str, share: float = 0.5) -> None:
    """A line with an arrow head at either end, and its text along it at a share of its length."""
    axes.annotate(
        "",
        tuple(end),
        xytext=tuple(start),
        arrowprops={"arrowstyle": "<|-|>", "color": INK, "linewidth": 0.5, "shrinkA": 0, "shrinkB": 0,
                    "mutation_scale": 6},
    )  # fmt: skip
    along = end - start
    turned = float(np.degrees(np.arctan2(along[1], along[0])))
    turned = turned - 180.0 if turned > 90.0 + 1e-6 else turned
    position = start + share * along
    axes.text(
        float(position[0]),
        float(position[1]),
        text,
        rotation=turned,
        rotation_mode="anchor",
        ha="center",
        va="center",
        bbox=_PAPER,
        zorder=5,
    )


def _angle(axes: "Axes", apex: Array, ends: tuple[Array, Array], text: str) -> None:
    """The angle at a point between the directions to two others, with its arc and text."""
    directions = [end - apex for end in ends]
    radius = 0.30 * min(float(np.linalg.norm(direction)) for direction in directions)
    turns = [float(np.arctan2(direction[1], direction[0])) for direction in directions]
    arc = np.linspace(turns[0], turns[1], 33)
    axes.plot(apex[0] + radius * np.cos(arc), apex[1] + radius * np.sin(arc), color=INK, linewidth=0.5)
    for end in ends:
        axes.plot(*zip(apex, end, strict=True), color=INK, linewidth=0.5)
    quarter = turns[0] + 0.25 * (turns[1] - turns[0])
    position = apex + 1.14 * radius * np.array([np.cos(quarter), np.sin(quarter)])
    axes.text(float(position[0]), float(position[1]), text, ha="center", va="center", bbox=_PAPER, zorder=5)
