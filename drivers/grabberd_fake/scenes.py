"""Scenes in front of the camera: the liner, an ellipse that moves as prescribed, and objects at rest."""

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from grabberd_fake.ellipse_liner import EllipseLiner
from grabberd_fake.liner import Liner
from grabberd_fake.optics import Array
from grabberd_fake.options import FakeOptions, PointOption
from grabberd_fake.targets import Targets, grid_numbers


class Scene(Protocol):
    """N targets in time.

    Attributes:
        ids: (N,) int32, ascending; `row`, `column`: (N,) int32, positions in the target grid.
        moves: True if `targets` depends on the time.
    """

    ids: NDArray[np.int32]
    row: NDArray[np.int32]
    column: NDArray[np.int32]
    moves: bool

    def targets(self, time_ns: int) -> Targets:
        """Positions of the targets; they depend on the time alone."""
        ...

    def nominal(self) -> Targets:
        """Positions of the targets in the object model."""
        ...


class Still:
    """A scene that stands still."""

    moves = False

    def __init__(
        self, targets: Targets, row: NDArray[np.int32], column: NDArray[np.int32], ids: NDArray[np.int32]
    ) -> None:
        self.ids, self.row, self.column = ids, row, column
        self._targets = targets

    @classmethod
    def grid(cls, targets: Targets, rows: int, columns: int) -> "Still":
        """Targets row by row, numbered from 1."""
        return cls(targets, *grid_numbers(rows, columns), np.arange(1, rows * columns + 1, dtype=np.int32))

    def targets(self, time_ns: int) -> Targets:
        """Targets at any time."""
        return self._targets

    def nominal(self) -> Targets:
        """Targets of the object model."""
        return self._targets


def build_scene(options: FakeOptions) -> Scene:
    """The scene that the options name."""
    match options.scene:
        case "liner":
            return Liner(options.liner)
        case "ellipse":
            return EllipseLiner(options.ellipse)
        case "calibration_frame":
            return calibration_frame()
        case "accuracy_object":
            return accuracy_object()
        case "points":
            return own_points(options.points)
    return own_points(())


# Steps without self-similarity, see `calibration_frame`.
_FRAME_ROW_MM = (-3.0, 2.0, 4.0, -4.0, 1.0, -2.0, 3.5, -3.5, 0.0, 4.0, -1.0, -4.0)
_FRAME_COLUMN_MM = (-4.0, 2.5, -1.0, 4.0, -2.5, 3.5, -4.0, 1.0, 4.0)


def calibration_frame() -> Still:
    """The paper's 108 targets: 12 rows 9.75 mm apart along X, 9 columns 6.5 mm along Y, steps of ±8 mm.

    It reaches over the whole liner. The height is a row's step plus a column's; neither series resembles
    itself one place on, so a wrong identity by one pitch does not fit.
    """
    row, column = grid_numbers(12, 9)
    height_mm = np.array(_FRAME_ROW_MM)[row] + np.array(_FRAME_COLUMN_MM)[column]
    places = np.column_stack([(row - 5.5) * 9.75, (column - 4.0) * 6.5, height_mm])
    return Still.grid(Targets(places, _facing_up(len(places))), 12, 9)


def accuracy_object() -> Still:
    """60 targets on a body unlike the calibration frame: a saddle with a step, 10 irregular rows of 6."""
    row, column = grid_numbers(10, 6)
    irregular_mm = np.random.default_rng(60).uniform(-1.2, 1.2, (60, 2))
    x, y = np.column_stack([(row - 4.5) * 9.5, (column - 2.5) * 7.0]).T + irregular_mm.T
    step_mm = np.where(row >= 5, 2.5, -2.5)
    z = step_mm + y * y / 60 - x * x / 400
    slope = np.column_stack([x / 200, -y / 30, np.ones(60)])
    places = np.column_stack([x, y, z]).round(4)
    return Still.grid(Targets(places, slope / np.linalg.norm(slope, axis=1, keepdims=True)), 10, 6)


def own_points(points: tuple[PointOption, ...]) -> Still:
    """The targets that the options list, sorted by id; each is a row of its own in the target grid."""
    ordered = sorted(points, key=lambda point: point.id)
    places = np.array([[p.x_mm, p.y_mm, p.z_mm] for p in ordered]).reshape(-1, 3)
    normals = np.array([_unit(p.nx, p.ny, p.nz) for p in ordered]).reshape(-1, 3)
    row, column = grid_numbers(len(ordered), 1)
    return Still(Targets(places, normals), row, column, np.array([p.id for p in ordered], np.int32))


def _facing_up(count: int) -> Array:
    return np.tile([0.0, 0.0, 1.0], (count, 1))


def _unit(x: float, y: float, z: float) -> tuple[float, float, float]:
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length
