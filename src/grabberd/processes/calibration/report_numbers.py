"""Numbers as a report's JSON document has them."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

AXES = ("x", "y", "z")


def number(value: float) -> float | None:
    """A number for JSON, where non-finite values become null."""
    return float(value) if np.isfinite(value) else None


def numbers(values: NDArray[np.float64]) -> list[Any]:
    """The rows of a table (N, M)."""
    return [[number(value) for value in row] for row in values]


def by_axis(before: str, after: str, values: Iterable[float]) -> dict[str, float | None]:
    """Two or three values by the names of their axes, such as dx_px and dy_px."""
    return {f"{before}{axis}{after}": number(value) for axis, value in zip(AXES, values, strict=False)}
