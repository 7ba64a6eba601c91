"""The points of a field as an analysis takes them.

Fields of a wall that stands still can be averaged: less noise, and fewer states whose pressure is sought.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.reconstruction import Points, SingleViewImages
from grabberd_liner.analysis.pulsation.movement import TimedPoints
from grabberd_liner.arrays import Array


class FieldPoints(NamedTuple):
    """The points of one field; `time_s` from the capture's first field."""

    n: int
    timed: TimedPoints


_SEEN_IN = 0.5
"""Share of the fields of an average in which a target has to be seen."""


def averaged_fields(fields: Sequence[FieldPoints], count: int) -> list[FieldPoints]:
    """Means of so many fields each, one after the other, numbered from 0; the last may be of fewer."""
    if count <= 1:
        return list(fields)
    parts = [fields[first : first + count] for first in range(0, len(fields), count)]
    return [FieldPoints(n, _mean([one.timed for one in part])) for n, part in enumerate(parts)]


def _mean(fields: Sequence[TimedPoints]) -> TimedPoints:
    time_s = float(np.mean([one.time_s for one in fields]))
    return TimedPoints(time_s, _mean_points([one.points for one in fields]))


def _mean_points(parts: Sequence[Points]) -> Points:
    joined = Points.joined(parts)
    mean = _Mean(joined.target, len(parts))
    return Points(
        mean.known,
        mean.of(joined.xyz_mm),
        mean.of(joined.covariance_mm2) / mean.count[:, np.newaxis, np.newaxis],
        mean.of(joined.calibration_covariance_mm2),
        mean.of(joined.image_px),
        mean.of(joined.residual_px),
        _mean_singles([one.single for one in parts if one.single], len(parts), mean.known),
    )


def _mean_singles(
    parts: Sequence[SingleViewImages], fields: int, by_both: NDArray[np.int32]
) -> SingleViewImages | None:
    if not parts:
        return None
    target, view, image_px, sigma_px = (
        np.concatenate([getattr(one, name) for one in parts])
        for name in ("target", "view", "image_px", "sigma_px")
    )
    alone = ~np.isin(target, by_both)
    # A target that now one view sees alone and now the other would count twice: the view that sees it more.
    mean = _Mean(2 * target[alone] + view[alone], fields)
    variance = mean.of(np.square(sigma_px[alone])) / mean.count[:, np.newaxis]
    image_px = mean.of(image_px[alone])
    best = np.lexsort((-mean.count, mean.known // 2))
    _, first = np.unique(mean.known[best] // 2, return_index=True)
    at = best[first]
    known = mean.known[at]
    return SingleViewImages(
        (known // 2).astype(np.int32), (known % 2).astype(np.intp), image_px[at], np.sqrt(variance[at])
    )


class _Mean:
    """Means over the rows that belong to the same key, of the keys that most fields have."""

    def __init__(self, keys: NDArray[np.int32], fields: int) -> None:
        known, self._at, count = np.unique(keys, return_inverse=True, return_counts=True)
        self._often, self._count = count >= _SEEN_IN * fields, count
        self.known, self.count = known[self._often], count[self._often]

    def of(self, values: Array) -> Array:
        """Means of (N, …) values."""
        summed = np.zeros((len(self._count), *values.shape[1:]))
        np.add.at(summed, self._at, values)
        mean: Array = summed / self._count.reshape(-1, *(1,) * (values.ndim - 1))
        return mean[self._often]
