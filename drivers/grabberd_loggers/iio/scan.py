"""Scans of a buffer: which bytes of one are which channel, by the types that the kernel states."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

TIMESTAMP = "timestamp"
_TYPE = re.compile(
    r"^(?P<order>le|be):(?P<sign>[su])(?P<bits>\d+)/(?P<storage>8|16|32|64)(X(?P<repeat>\d+))?(>>(?P<shift>\d+))?$"
)


class Element(NamedTuple):
    """A channel in a scan.

    Attributes:
        name: Its name.
        position: Its place among the others, from 0.
        type: What the kernel states, e.g. "le:s24/32>>8".
    """

    name: str
    position: int
    type: str


@dataclass(frozen=True, slots=True)
class _Place:
    offset: int
    dtype: np.dtype[np.generic]
    shift: int
    bits: int
    is_signed: bool


class ScanFormat:
    """Decodes the bytes of scans.

    Every element lies at a multiple of its own size, and a scan is as long as a multiple of the largest.

    Args:
        elements: The enabled channels, the timestamp among them.

    Raises:
        ValueError: A type is none that is known.
    """

    def __init__(self, elements: Sequence[Element]) -> None:
        end, largest = 0, 1
        self._places: dict[str, _Place] = {}
        for element in sorted(elements, key=lambda one: one.position):
            place, size = _placed(element, end)
            self._places[element.name] = place
            end, largest = place.offset + size, max(largest, size)
        self.bytes = -(-end // largest) * largest

    def decode(self, data: bytes) -> dict[str, NDArray[np.int64]]:
        """Numbers of each channel in whole scans."""
        scans = np.frombuffer(data, np.uint8).reshape(-1, self.bytes)
        return {name: _numbers(scans, place) for name, place in self._places.items()}


def _placed(element: Element, end: int) -> tuple[_Place, int]:
    match = _TYPE.match(element.type)
    if match is None or int(match["repeat"] or 1) != 1:
        raise ValueError(f"{element.name} has the type {element.type!r}, which is not known")
    size = int(match["storage"]) // 8
    bits, shift = int(match["bits"]), int(match["shift"] or 0)
    if not 0 < bits + shift <= 8 * size:
        raise ValueError(f"{element.name} has the type {element.type!r}, which is impossible")
    offset = -(-end // size) * size
    dtype = np.dtype(f"{'<' if match['order'] == 'le' else '>'}u{size}")
    return _Place(offset, dtype, shift, bits, match["sign"] == "s"), size


def _numbers(scans: NDArray[np.uint8], place: _Place) -> NDArray[np.int64]:
    cells = np.ascontiguousarray(scans[:, place.offset : place.offset + place.dtype.itemsize])
    raw = cells.view(place.dtype)[:, 0].astype(np.uint64) >> np.uint64(place.shift)
    unused = np.uint64(64 - place.bits)
    # Shifted to the top and back: the second shift fills in the sign, or zeros.
    top = raw << unused
    back: NDArray[np.int64] = (
        top.view(np.int64) >> np.int64(unused) if place.is_signed else (top >> unused).astype(np.int64)
    )
    return back
