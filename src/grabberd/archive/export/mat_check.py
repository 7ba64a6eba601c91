"""A check of written MAT-files, tag by tag: every variable and field, with the size that it was to have.

The format: https://www.mathworks.com/help/pdf_doc/matlab/matfile_format.pdf
"""

import os
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np

from grabberd.archive.export.mat_file import Struct
from grabberd.files.checked_file import Check

_HEAD_BYTES = 128
_BEGINS = b"MATLAB 5.0 MAT-file"
_MATRIX, _STRUCT = 14, 2


class _Array(NamedTuple):
    """The beginning of an array, and the place in the file where it ends."""

    kind: int
    shape: tuple[int, ...]
    name: str
    end: int


def mat_check(variables: Mapping[str, Struct]) -> Check:
    """A MAT-file with these structs, whose fields have the sizes of theirs."""

    def check(path: Path) -> str | None:
        with path.open("rb") as file:
            if not file.read(_HEAD_BYTES).startswith(_BEGINS):
                return "it does not begin as a MAT-file"
            found = dict(_variables(file, path.stat().st_size))
        if list(found) != list(variables):
            return f"its variables are {', '.join(found)}"
        for name, expected in variables.items():
            if list(found[name]) != list(expected):
                return f"the fields of {name} are {', '.join(found[name])}"
            for field, value in expected.items():
                if found[name][field] != _shape(value):
                    return f"{name}.{field} has the size {found[name][field]}, expected {_shape(value)}"
        return None

    return check


def _shape(value: object) -> tuple[int, ...]:
    if isinstance(value, str):
        return (1, len(value)) if value else (0, 0)
    return np.shape(value) if isinstance(value, np.ndarray) else (1, 1)


def _variables(file: IO[bytes], size: int) -> Iterator[tuple[str, dict[str, tuple[int, ...]]]]:
    """Name of each struct, and the sizes of its fields."""
    while file.tell() < size:
        array = _array(file)
        fields = dict(_fields(file)) if array.kind == _STRUCT else {}
        if file.tell() != array.end or array.end > size:
            raise ValueError(f"{array.name} ends at {file.tell()}, expected {array.end} of {size} bytes")
        yield array.name, fields


def _fields(file: IO[bytes]) -> Iterator[tuple[str, tuple[int, ...]]]:
    (length,) = struct.unpack("<i", _values(file))
    names = _values(file)
    for first in range(0, len(names), length):
        array = _array(file)
        file.seek(array.end)
        yield names[first : first + length].rstrip(b"\0").decode("ascii"), array.shape


def _array(file: IO[bytes]) -> _Array:
    kind, size = struct.unpack("<II", file.read(8))
    if kind != _MATRIX:
        raise ValueError(f"an element of type {kind} at {file.tell() - 8}")
    end = file.tell() + size
    flags, dimensions, name = (_values(file) for _ in range(3))
    shape = struct.unpack(f"<{len(dimensions) // 4}i", dimensions)
    return _Array(flags[0], shape, name.decode("ascii"), end)


def _values(file: IO[bytes]) -> bytes:
    """The values of an element; up to four bytes of them stand in its tag."""
    kind, size = struct.unpack("<II", tag := file.read(8))
    if kind >> 16:
        return tag[4 : 4 + (kind >> 16)]
    values = file.read(size)
    file.seek(-size % 8, os.SEEK_CUR)
    return values
