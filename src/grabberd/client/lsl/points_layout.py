"""The channels of a stream of points: six for each target of the object model, always in its sequence."""

import hashlib
from collections.abc import Iterator
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.groups.quanta import PER_MM, rounded
from grabberd.documents.points_frame import PointsFrame

_VARIANCES = [0, 3, 5]
"""Those of x, y and z among the six elements of a covariance."""
PARTS = (
    *(("x", "PositionX"), ("y", "PositionY"), ("z", "PositionZ")),
    *(("sigma_x", "SigmaX"), ("sigma_y", "SigmaY"), ("sigma_z", "SigmaZ")),
)
"""Ending of each channel's label, and its type."""
UNIT = "millimeters"


class Channel(NamedTuple):
    """A channel as its metadata describes it."""

    label: str
    type: str
    unit: str
    target: int
    row: int
    column: int


class PointsLayout:
    """The targets of an object model and their channels.

    Args:
        name: Name of the object model.
        places: Id, row and column of each target.

    Attributes:
        name: Name of the object model.
    """

    def __init__(self, name: str, places: tuple[tuple[int, int, int], ...]) -> None:
        self.name = name
        self._places = places
        self._index = {target: k for k, (target, _, _) in enumerate(places)}

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> Self:
        """The layout of an object model as `GET /api/v1/devices/NAME/object` describes it."""
        columns = (document["target"], document["row"], document["column"])
        return cls(document["name"], tuple(zip(*columns, strict=True)))

    def __eq__(self, other: object) -> bool:
        """True if both have the same channels in the same sequence, and the same object model's name."""
        return isinstance(other, PointsLayout) and self._said == other._said

    def __hash__(self) -> int:
        """Hash of what makes them equal."""
        return hash(self._said)

    @property
    def digest(self) -> str:
        """Eight characters that differ where the layouts do."""
        return hashlib.sha256(repr(self._said).encode()).hexdigest()[:8]

    @property
    def channel_count(self) -> int:
        """Number of channels."""
        return len(self._places) * len(PARTS)

    def channels(self) -> Iterator[Channel]:
        """Every channel, in its sequence."""
        for target, row, column in self._places:
            for ending, kind in PARTS:
                yield Channel(f"{target}_{ending}", kind, UNIT, target, row, column)

    def covers(self, frame: PointsFrame) -> bool:
        """True if every target of a field has channels."""
        return all(target in self._index for target in frame.target.tolist())

    def sample(self, frame: PointsFrame) -> NDArray[np.float32]:
        """(channel_count,), one field; NaN where a target was not found.

        Positions are rounded as in a capture file, so that a sample has the numbers of the file in 32 bits.
        σ is that from pointing and line jitter.
        """
        values = np.full((len(self._places), len(PARTS)), np.nan, np.float32)
        found = frame.target.tolist()
        known = [k for k, target in enumerate(found) if target in self._index]
        at = [self._index[found[k]] for k in known]
        values[at, :3] = rounded(frame.xyz_mm[known], PER_MM)
        values[at, 3:] = np.sqrt(frame.covariance_mm2[known][:, _VARIANCES])
        return values.ravel()

    @property
    def _said(self) -> tuple[str, tuple[tuple[int, int, int], ...]]:
        return self.name, self._places
