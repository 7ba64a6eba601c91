"""The pictures of a group of fields as one frame of bytes."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.codec import unpacked
from grabberd.archive.capture.groups.frames import frame_of
from grabberd.core.field import PackedField
from grabberd.core.field.field import packed_shape

MOST_FIELDS = 32
"""Fields of a group: a commit has 25 of them at 50 Hz, give or take a few."""
LARGEST_GROUP = 16 << 20
"""Bytes of a group's pictures, unless it has one field alone; as many as the largest picture."""


def pictures_size(count: int, rows: int, columns: int, bits: int) -> int:
    """Bytes of so many pictures before they are compressed."""
    return count * math.prod(packed_shape(rows, columns, bits))


def encode_pictures(fields: Sequence[PackedField]) -> bytes:
    """Encodes pictures of one size and number of bits.

    Packed planes are written column by column, each of eight pixels: the edge of a target changes little from
    line to line, so runs of equal bytes are long, and so are repetitions from field to field.
    """
    return frame_of([b"".join(_downward(field).tobytes() for field in fields)])


def _downward(field: PackedField) -> NDArray[np.uint8]:
    return field.data if field.bits == 8 else field.data.swapaxes(1, 2)


def decode_pictures(data: bytes, count: int, rows: int, columns: int, bits: int) -> list[NDArray[np.uint8]]:
    """Decodes pictures into `PackedField.data`, each in memory of its own.

    Raises:
        ValueError: There cannot be so many, or the bytes are damaged or those of other pictures.
    """
    size = pictures_size(count, rows, columns, bits)
    if count not in range(1, MOST_FIELDS + 1) or (count > 1 and size > LARGEST_GROUP):
        raise ValueError(f"a group of {count} fields with {size} bytes of pictures")
    planes, lines, across = packed_shape(rows, columns, bits)
    content = np.frombuffer(unpacked(data, size), np.uint8)
    if bits == 8:
        return [picture.copy() for picture in content.reshape(count, planes, lines, across)]
    pictures = content.reshape(count, planes, across, lines)
    return [np.ascontiguousarray(picture.swapaxes(1, 2)) for picture in pictures]
