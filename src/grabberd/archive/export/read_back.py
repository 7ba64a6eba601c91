"""Checks of written files by readers that share nothing with the writers."""

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from grabberd.core.chain.columns import Column
from grabberd.files.checked_file import Check
from grabberd.tables import table_rows

_PLY_BYTES = {"int": 4, "float": 4, "double": 8}
_C3D_BLOCK = 512
_C3D_WORDS = 1 << 20
"""Markers that are read at a time."""
_FACE_BYTES = 13
"""A triangle in PLY: the number of its corners in a byte, and three of four bytes."""


def csv_check(columns: Sequence[str], rows: Callable[[], int], separator: str = ",") -> Check:
    """CSV with these columns; `rows` is asked for their number once all have been written."""

    def check(path: Path) -> str | None:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = table_rows(file, separator)
            if (head := next(lines, (0, []))[1]) != list(columns):
                return f"its columns are {', '.join(head)}"
            count = 0
            for count, (number, line) in enumerate(lines, 1):  # noqa: B007 - the count is used after the loop
                if len(line) != len(columns):
                    return f"line {number} has {len(line)} values of {len(columns)}"
        return _counted(count, rows())

    return check


def parquet_check(columns: Sequence[str], rows: Callable[[], int]) -> Check:
    """Parquet with these columns; every row group is read, and every page's checksum compared."""

    def check(path: Path) -> str | None:
        import pyarrow.parquet as pq  # type: ignore[import-untyped]  # noqa: PLC0415 - optional, slow to import

        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            if file.schema_arrow.names != list(columns):
                return f"its columns are {', '.join(file.schema_arrow.names)}"
            return _counted(sum(batch.num_rows for batch in file.iter_batches()), rows())

    return check


def hdf5_check(
    columns: Mapping[str, Sequence[Column]], rows: Mapping[str, int], groups: Iterable[str] = ()
) -> Check:
    """HDF5 with a group for each table and further groups; see `csv_check`, each table by its name."""

    def check(path: Path) -> str | None:
        import h5py  # type: ignore[import-untyped]  # noqa: PLC0415 - optional

        with h5py.File(path, "r") as file:
            for table, expected in columns.items():
                group = file[table]
                if list(group) != [column.name for column in expected]:
                    return f"the columns of {table} are {', '.join(group)}"
                for name, values in group.items():
                    if wrong := _counted(len(values[()]), rows[table]):
                        return f"{table}, {name}: {wrong}"
            return next((f"it lacks the group {name}" for name in groups if name not in file), None)

    return check


def ply_check(vertices: Callable[[], int], triangles: int = 0) -> Check:
    """Binary PLY with so many vertices and triangles, as its head says and its size shows."""

    def check(path: Path) -> str | None:
        with path.open("rb") as file:
            lines = itertools.takewhile(lambda line: line != b"end_header\n", file)
            head = [line.decode("ascii").split() for line in lines]
            size = path.stat().st_size - file.tell()
        counts = {words[1]: int(words[2]) for words in head if words[0] == "element"}
        each = sum(_PLY_BYTES[words[1]] for words in head if words[0] == "property" and words[1] != "list")
        if wrong := _counted(counts.get("vertex", 0), vertices()) or _counted(
            counts.get("face", 0), triangles
        ):
            return wrong
        expected = vertices() * each + triangles * _FACE_BYTES
        return None if size == expected else f"it has {size} bytes of data, expected {expected}"

    return check


def c3d_check(markers: int, frames: int, points: int, analog: int = 0) -> Check:
    """C3D with so many markers and frames, and as many valid markers in all frames together as points.

    Args:
        markers: Number of markers.
        frames: Number of frames.
        points: Number of points.
        analog: Number of analog samples of all channels in a frame.
    """
    each = 4 * markers + analog
    at_once = max(_C3D_WORDS // each, 1)

    def check(path: Path) -> str | None:
        with path.open("rb") as file:
            head = file.read(_C3D_BLOCK)
            if head[:2] != b"\x02\x50":
                return "it does not begin as C3D"
            found, others, first_block = (int.from_bytes(head[at : at + 2], "little") for at in (2, 4, 16))
            if found != markers:
                return f"it has {found} markers, expected {markers}"
            if others != analog:
                return f"it has {others} analog samples to a frame, expected {analog}"
            data = (first_block - 1) * _C3D_BLOCK
            size = data + -(-frames * each * 4 // _C3D_BLOCK) * _C3D_BLOCK
            if path.stat().st_size != size:
                return f"it has {path.stat().st_size} bytes, expected {size}"
            file.seek(data)
            valid = 0
            for first in range(0, frames, at_once):
                words = np.fromfile(file, "<f4", each * min(at_once, frames - first)).reshape(-1, each)
                valid += int((words[:, 3 : 4 * markers : 4] >= 0).sum())
        return _counted(valid, points)

    return check


def xml_check(elements: Mapping[str, int]) -> Check:
    """Well-formed XML with so many elements of each of these names."""

    def check(path: Path) -> str | None:
        found = dict.fromkeys(elements, 0)

        def count(name: str, _: dict[str, str]) -> None:
            if name in found:
                found[name] += 1

        parser = expat.ParserCreate()
        parser.StartElementHandler = count
        try:
            with path.open("rb") as file:
                parser.ParseFile(file)
        except expat.ExpatError as error:
            return f"it is no XML ({error})"
        return None if found == dict(elements) else f"it has {found}, expected {dict(elements)}"

    return check


def png_check(picture: NDArray[np.uint8]) -> Check:
    """PNG of exactly these pixels."""

    def check(path: Path) -> str | None:
        import cv2  # noqa: PLC0415 - 16 MB, which the daemon seldom needs

        read = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED)
        if read is None:
            return "it is no PNG"
        same = read.shape == picture.shape and np.array_equal(read, picture)
        return None if same else f"its picture of {read.shape} is another one"

    return check


def _counted(found: int, expected: int) -> str | None:
    return None if found == expected else f"it has {found} rows, expected {expected}"
