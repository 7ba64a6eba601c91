"""Blobs: the images of targets in one field."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class Blobs:
    """N blobs located in one field, both views together, in the order of their first row and column.

    Attributes:
        xy_px: (N, 2) float64, frame pixels: x in columns, y in frame lines.
        sigma_px: (N, 2) float64, standard deviation of `xy_px` from location alone, without line jitter.
        common_px: (N,) float64, standard deviation of the residual line jitter in x, an error shared by all
            blobs on the same lines, in both views.
        area_px: (N,) float64, size above the threshold in square *frame* pixels (rows of an intact field
            count twice).
        width_px: (N,) float64, number of columns spanned.
        height_px: (N,) float64, number of frame lines spanned.
        at_border: (N,) bool, True for a blob cut off by the edge of the field.
        common_reach_px: Distance in frame lines over which the correlation of that shared error falls to
            e^−½.
        line_jitter_px: Standard deviation of a line's shift in this field; None if not estimated.
    """

    xy_px: NDArray[np.float64]
    sigma_px: NDArray[np.float64]
    common_px: NDArray[np.float64]
    area_px: NDArray[np.float64]
    width_px: NDArray[np.float64]
    height_px: NDArray[np.float64]
    at_border: NDArray[np.bool_]
    common_reach_px: float
    line_jitter_px: float | None = None

    def __len__(self) -> int:
        return len(self.xy_px)

    def select(self, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> "Blobs":
        """Select blobs by a mask or index array."""
        columns: Any = [getattr(self, name)[chosen] for name in _COLUMNS]
        return Blobs(*[*columns, self.common_reach_px, self.line_jitter_px])


_COLUMNS = ("xy_px", "sigma_px", "common_px", "area_px", "width_px", "height_px", "at_border")
