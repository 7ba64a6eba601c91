"""Directories of a TIFF: how many pages it has, and whether all of their bytes are there.

A decoder fills up what a truncated file lacks, and reads the first page of several.
"""

import struct
from collections.abc import Iterator

_STRIPS, _TILES = (273, 279), (324, 325)
"""Tags with the places of parts of a picture and with their sizes in bytes."""
_SIZES = {3: ("H", 2), 4: ("I", 4), 16: ("Q", 8)}
_MOST_PAGES, _MOST_PARTS = 1000, 1 << 20


class TiffFault(Exception):
    """The directories are damaged, or lead beyond the end of the file."""


def pages(data: bytes) -> int:
    """Number of pages, all of whose bytes are in the file.

    Raises:
        TiffFault: some are not.
    """
    try:
        return sum(1 for _ in _directories(data))
    except (struct.error, KeyError) as error:
        raise TiffFault from error


def _directories(data: bytes) -> Iterator[int]:
    order = "<" if data[:2] == b"II" else ">"
    big = struct.unpack_from(order + "H", data, 2)[0] == 43
    counts, entry, places = ("Q", 20, "Q") if big else ("H", 12, "I")
    (at,) = struct.unpack_from(order + places, data, 8 if big else 4)
    for _ in range(_MOST_PAGES):
        if not at:
            return
        (count,) = struct.unpack_from(order + counts, data, at)
        first = at + struct.calcsize(counts)
        if not 0 < count <= _MOST_PARTS or first + count * entry + struct.calcsize(places) > len(data):
            raise TiffFault
        tags = dict(_values(data, order, first + k * entry, places) for k in range(count))
        for offsets, sizes in (_STRIPS, _TILES):
            for offset, size in zip(tags.get(offsets, ()), tags.get(sizes, ()), strict=True):
                if offset + size > len(data):
                    raise TiffFault
        yield at
        (at,) = struct.unpack_from(order + places, data, first + count * entry)


def _values(data: bytes, order: str, at: int, places: str) -> tuple[int, tuple[int, ...]]:
    """Tag and values of an entry, where these are places or sizes."""
    tag, kind = struct.unpack_from(order + "HH", data, at)
    if tag not in _STRIPS + _TILES:
        return tag, ()
    (count,) = struct.unpack_from(order + places, data, at + 4)
    letter, size = _SIZES[kind]
    inline = struct.calcsize(places)
    if count > _MOST_PARTS:
        raise TiffFault
    place = at + 4 + inline
    if count * size > inline:
        (place,) = struct.unpack_from(order + places, data, place)
    return tag, struct.unpack_from(f"{order}{count}{letter}", data, place)
