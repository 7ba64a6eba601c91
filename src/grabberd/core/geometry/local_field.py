"""Local field: smooth displacements in one view's half of the picture that the global model does not explain.

    observed = equations (6), (7) + field(observed position)

The field is a uniform bicubic spline. It spans the whole half: where the calibration frame had no targets
nearby, its estimate has faded to zero and its σ has grown to the prior's, so no special rule for such places
is needed. Nothing is seen beyond the half; positions there take the value of the nearest edge.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grabberd.core.geometry.document_reader import Reading

Array = NDArray[np.float64]

_KEYS = ("origin_px", "step_px", "x_px", "y_px", "sigma_x_px", "sigma_y_px")
_CUBIC = np.array([[1, -3, 3, -1], [4, 0, -6, 3], [1, 3, 3, -3], [0, 0, 0, 1]]) / 6.0
"""Four pieces of the uniform cubic B-spline over one interval, by powers of the position in it."""
_SHORT = 1e-9
"""Intervals by which the last position is kept short of the last node, so that it has an interval."""
_LEAST_NODES = 4


@dataclass(frozen=True, slots=True, eq=False)
class LocalField:
    """Spline with a coefficient at every node of a square grid.

    Attributes:
        origin_px: Frame pixel (x, y) where the spline begins; its first coefficients lie one step before.
        step_px: Distance between nodes, in columns and in frame lines.
        shift_px: (rows, columns, 2) float64, coefficients of the displacement in x and y.
        sigma_px: (rows, columns, 2) float64, coefficients of its standard deviation.
    """

    origin_px: tuple[float, float]
    step_px: float
    shift_px: Array
    sigma_px: Array

    @classmethod
    def through(
        cls, origin_px: tuple[float, float], step_px: float, shift: Array, sigma: Array
    ) -> "LocalField":
        """Interpolate displacements at the nodes by a natural spline.

        Args:
            origin_px: Frame pixel of the first node.
            step_px: Distance between nodes, in columns and in frame lines.
            shift: (rows, columns, 2) displacements at the nodes, frame pixels.
            sigma: (rows, columns, 2) their standard deviations; used as coefficients, which smooths them a
                little and keeps them above 0 everywhere.
        """
        edges = np.pad(sigma, ((1, 1), (1, 1), (0, 0)), mode="edge")
        return cls(
            origin_px, step_px, _interpolating(_interpolating(shift).swapaxes(0, 1)).swapaxes(0, 1), edges
        )

    @classmethod
    def unknown(cls, first_column: int, end_column: int, lines: int, sigma_px: float) -> "LocalField":
        """Make one of which only the size is known, the same everywhere."""
        step = max(end_column - first_column, lines) / (_LEAST_NODES - 1)
        nowhere = np.zeros((_LEAST_NODES, _LEAST_NODES, 2))
        return cls.through((first_column - 0.5, -0.5), step, nowhere, nowhere + sigma_px)

    def at(self, xy_px: Array) -> Array:
        """(N, 2) float64 displacements in frame pixels at observed positions (N, 2)."""
        return self._value(self.shift_px, xy_px)

    def sigma_at(self, xy_px: Array) -> Array:
        """(N, 2) float64 standard deviations of x and y left after subtracting `at`, frame pixels."""
        return self._value(self.sigma_px, xy_px)

    @classmethod
    def from_document(cls, reading: Reading, where: str, values: Mapping[str, Any]) -> "LocalField":
        """Read the field from its part of a calibration document; problems are added to `reading`."""
        reading.keys(where, values, _KEYS)
        shape = _shape(reading, where, values.get("x_px"))
        x, y, sigma_x, sigma_y = (reading.numbers(values.get(key), where + key, shape) for key in _KEYS[2:])
        if min(sigma_x.min(), sigma_y.min()) < 0:
            reading.problems.append(f"{where}sigma_x_px, sigma_y_px: a standard deviation is below 0")
        origin = reading.numbers(values.get("origin_px"), where + "origin_px", (2,)).tolist()
        step = reading.number(values, "step_px", where, positive=True)
        return cls(
            (origin[0], origin[1]), step, np.stack([x, y], axis=2), np.stack([sigma_x, sigma_y], axis=2)
        )

    def to_document(self) -> dict[str, Any]:
        """Convert to its part of the document; `from_document` restores the same field bit for bit."""
        channels = [*np.moveaxis(self.shift_px, 2, 0), *np.moveaxis(self.sigma_px, 2, 0)]
        arrays = zip(_KEYS[2:], (channel.tolist() for channel in channels), strict=True)
        return {"origin_px": list(self.origin_px), "step_px": self.step_px, **dict(arrays)}

    def _value(self, coefficients: Array, xy_px: Array) -> Array:
        rows, columns, _ = coefficients.shape
        position = (xy_px - self.origin_px) * (1.0 / self.step_px)
        np.clip(position, 0.0, (columns - 3 - _SHORT, rows - 3 - _SHORT), out=position)
        first = position.astype(np.intp)
        along_x, along_y = _weights(position - first)
        taps = coefficients.reshape(-1, 2).take(
            (first[:, 1] * columns + first[:, 0])[:, np.newaxis] + _taps(columns), axis=0
        )
        strips = along_y[:, np.newaxis] @ taps.reshape(-1, 4, 8)
        return (along_x[:, np.newaxis] @ strips.reshape(-1, 4, 2))[:, 0]


def _weights(part: Array) -> Array:
    """(2, N, 4) weights of the four coefficients along x and along y, at a part (N, 2) of an interval."""
    powers = np.ones((4, *part.shape))
    powers[1] = part
    np.multiply(part, part, out=powers[2])
    np.multiply(powers[2], part, out=powers[3])
    return (_CUBIC @ powers.reshape(4, -1)).reshape(4, *part.shape).transpose(2, 1, 0)


def _taps(columns: int) -> NDArray[np.intp]:
    """(16,) offsets of the coefficients that a position depends on from the first of them."""
    return (np.arange(4)[:, np.newaxis] * columns + np.arange(4)).ravel()


def _interpolating(values: Array) -> Array:
    """Coefficients along the first axis, two more than values; linear beyond the ends."""
    count = len(values)
    matrix = (np.eye(count + 2) + 4 * np.eye(count + 2, k=1) + np.eye(count + 2, k=2))[:count] / 6.0
    straight = np.zeros((2, count + 2))
    straight[0, :3] = straight[1, -3:] = (1.0, -2.0, 1.0)
    right = np.concatenate([values, np.zeros((2, *values.shape[1:]))]).reshape(count + 2, -1)
    solved: Array = np.linalg.solve(np.concatenate([matrix, straight]), right)
    return solved.reshape(count + 2, *values.shape[1:])


def _shape(reading: Reading, where: str, value: object) -> tuple[int, int]:
    """Rows and columns of the first array; a harmless shape if it is invalid."""
    if isinstance(value, list) and value and isinstance(value[0], list):
        shape = len(value), len(value[0])
        if min(shape) >= _LEAST_NODES:
            return shape
    reading.refuse(where + "x_px", value, f"at least {_LEAST_NODES} rows of {_LEAST_NODES} numbers")
    return _LEAST_NODES, _LEAST_NODES
