"""What is taken home from a capture file: points as CSV, PLY and Parquet, fields as pictures."""

import csv
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import cv2
import numpy as np
from numpy.typing import NDArray

from grabberd.errors import InputError
from grabberd.field import BOTTOM, TOP, PackedField, unpack
from grabberd.storage.capture.reader import CaptureReader
from grabberd.storage.capture.rows import RecordedField
from grabberd.storage.capture.schema import storage_errors
from grabberd.storage.export.columns import POINT_COLUMNS
from grabberd.storage.export.csv_ply import PLY_BYTES, points_csv, points_ply
from grabberd.storage.export.folders import new_folder
from grabberd.storage.export.parquet import check_parquet, write_parquet

MANIFEST_COLUMNS = ("n", "time_ns", "sequence", "parity", "y0", "y_step", "outcome", "file")
MANIFEST = "fields.csv"

__all__ = [
    "MANIFEST_COLUMNS",
    "POINT_COLUMNS",
    "export_csv",
    "export_parquet",
    "export_ply",
    "export_png",
    "field_png",
    "points_csv",
    "points_ply",
]


def field_png(path: Path, n: int) -> bytes:
    """One field as a grey PNG: its own rows where they are intact, the full height where lines are doubled.

    Raises:
        CaptureFileError, NotFound: no such file or field.
    """
    with CaptureReader(path) as reader:
        return _png(unpack(reader.field(n).numbered.packed).luma)


def _png(luma: NDArray[np.uint8]) -> bytes:
    return bytes(cv2.imencode(".png", luma, [cv2.IMWRITE_PNG_COMPRESSION, 1])[1])


def export_png(path: Path, directory: Path, *, woven: bool = False) -> int:
    """A folder of pictures, and `fields.csv`, which says what each field is; returns how many pictures.

    A picture is a field, or, `woven`, a frame of a top field and the bottom field after it; the rows of one
    that is not in the file stay black, and the manifest does not list it. The folder can be played again by
    the replay driver, with the same times, parities and gaps.

    Raises:
        CaptureFileError: no capture.
        InputError: doubled fields cannot be woven.
        StorageError: the folder cannot be written, or has something in it.
    """
    with CaptureReader(path) as reader:
        if woven and reader.meta.lines == "doubled":
            raise InputError(f"the lines of {path} are doubled, so they cannot be woven", "export its fields")
        new_folder(directory)
        with (
            storage_errors(directory),
            (directory / MANIFEST).open("w", newline="", encoding="utf-8") as file,
        ):
            manifest = csv.writer(file)
            manifest.writerow(MANIFEST_COLUMNS)
            count = 0
            for picture in _frames(reader.fields()) if woven else ((field,) for field in reader.fields()):
                manifest.writerows(_write_picture(picture, directory, "frame" if woven else "field"))
                count += 1
    return count


def _frames(fields: Iterable[RecordedField]) -> Iterator[tuple[RecordedField, ...]]:
    """Top fields with the bottom field after them; others alone."""
    frame: tuple[RecordedField, ...] = ()
    for field in fields:
        n, parity = field.numbered.n, field.numbered.packed.parity
        if frame and (parity == TOP or n != frame[0].numbered.n + 1):
            yield frame
            frame = ()
        frame = (*frame, field)
        if parity == BOTTOM:
            yield frame
            frame = ()
    if frame:
        yield frame


def _write_picture(
    picture: Sequence[RecordedField], directory: Path, what: str
) -> Iterator[tuple[object, ...]]:
    name = f"{what}-{picture[0].numbered.n:08d}.png"
    packed = [field.numbered.packed for field in picture]
    (directory / name).write_bytes(_png(_weave(packed) if what == "frame" else unpack(packed[0]).luma))
    for field in picture:
        n, time_ns, sequence, p = field.numbered
        yield (n, time_ns, sequence, p.parity, p.y0, p.y_step, str(field.outcome), name)


def _weave(fields: Sequence[PackedField]) -> NDArray[np.uint8]:
    frame = np.zeros((2 * fields[0].rows, fields[0].columns), np.uint8)
    for field in fields:
        frame[field.parity :: 2] = unpack(field).luma
    return frame


def export_csv(path: Path, directory: Path, run: int | None = None) -> int:
    """`points.csv` in a folder; returns how many points.

    Raises:
        CaptureFileError, NotFound: no such file or run.
        StorageError: the folder cannot be written, or has something in it.
    """
    text = points_csv(path, run)
    rows = -1
    with _new_file(directory, "points.csv") as file:
        for part in text:
            file.write(part.encode())
            rows += part.count("\n")
    return rows


def export_ply(path: Path, directory: Path, run: int | None = None, field: int | None = None) -> int:
    """`points.ply` in a folder, of all fields or of one; returns how many points.

    Raises:
        CaptureFileError, NotFound, StorageError: see `points_ply` and `export_csv`.
    """
    parts = points_ply(path, run, field)
    with _new_file(directory, "points.ply") as file:
        file.write(next(parts))
        return sum(file.write(part) for part in parts) // PLY_BYTES


def export_parquet(path: Path, directory: Path, run: int | None = None) -> int:
    """`points.parquet` in a folder; returns how many points.

    Raises:
        CaptureFileError, NotFound, ExtraMissing, StorageError: see `write_parquet` and `export_csv`.
    """
    check_parquet()
    with CaptureReader(path) as reader:
        number = reader.run(run).run
    with _new_file(directory, "points.parquet") as file:
        return write_parquet(path, number, file)


@contextmanager
def _new_file(directory: Path, name: str) -> Iterator[IO[bytes]]:
    new_folder(directory)
    with storage_errors(directory), (directory / name).open("wb") as file:
        yield file
