"""The rig as calibrated: both views, their covariance, and where they come from."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grabberd.geometry.view import View

SCHEMA = "grabberd/calibration/1"


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """Two virtual cameras.

    Attributes:
        id: name of this calibration.
        created_utc: ISO 8601.
        source: what it was made from, for people.
        columns: picture width in pixels; `lines`: height in frame lines.
        left: the left view; `right`: the right one.
        covariance: (36, 36) float64 of left's then right's `PARAMETERS`; zero where a parameter was held.
        sigma0_px: standard deviation of unit weight, or None where nothing was adjusted.
        glass: thickness_mm and refractive_index of the plate that was in place, or None.
        details: everything else of the document (certificate, temperature, protocol …), carried along unread.
    """

    id: str
    created_utc: str
    source: str
    columns: int
    lines: int
    left: View
    right: View
    covariance: NDArray[np.float64]
    sigma0_px: float | None = None
    glass: Mapping[str, float] | None = None
    details: Mapping[str, Any] = field(default_factory=dict)

    @property
    def views(self) -> tuple[View, View]:
        """Left and right."""
        return self.left, self.right

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> "Calibration":
        """The calibration from a JSON document.

        Raises:
            InputError: schema, key or value is not what it should be; the message names it.
        """
        raise NotImplementedError

    def to_document(self) -> dict[str, Any]:
        """The JSON document; `from_document` gives back the same calibration, bit for bit."""
        raise NotImplementedError
