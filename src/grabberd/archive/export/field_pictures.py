"""Fields of a capture as grey PNG: one, a folder of all that the replay driver can play again, a thumbnail.

They are written without OpenCV: it takes two to five times as long for fields, writes a little more, and to
load it holds the interpreter for 60 to 140 ms, in which a grabber with few buffers loses fields.
"""

import csv
import struct
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.digests import Damage
from grabberd.archive.capture.reader import CaptureReader, Opened
from grabberd.archive.capture.rows import RecordedField
from grabberd.archive.export.points_export import write_ledger_file, write_left_out_file
from grabberd.archive.export.read_back import png_check
from grabberd.core.field import unpack
from grabberd.errors import NotFound
from grabberd.files.checked_file import write_checked
from grabberd.files.disk import new_folder, storage_errors

MANIFEST_COLUMNS = ("n", "time_ns", "sequence", "parity", "y0", "y_step", "outcome", "file")
MANIFEST = "fields.csv"
SHARE = 4
"""Pixels and frame lines that become one in a thumbnail."""
_AROUND = 50
"""Fields among which that of a thumbnail is the nearest to the middle: the middle one may be lost."""
_FAST = 1
"""Level of compression."""
_EIGHT_BITS, _GREY = 8, 0


def field_png(path: Path, n: int, opened: Opened = CaptureReader) -> bytes:
    """One field as a grey PNG: its own rows where they are intact, the full height where lines are doubled.

    Args:
        path: The capture.
        n: Number of the field.
        opened: Opens the capture.

    Raises:
        CaptureFileError, NotFound: No such file or field.
    """
    with opened(path) as reader:
        return picture_png(reader.field(n))


def picture_png(field: RecordedField) -> bytes:
    """A field that was read, likewise."""
    return grey_png(unpack(field.numbered.packed).luma)


def export_png(path: Path, directory: Path, left_out: list[Damage] | None = None) -> int:
    """Writes a folder of pictures, and `fields.csv`, which lists the fields; returns the number of pictures.

    Damaged fields and those without a signal are among them, marked; `ledger.csv` has all others as well. The
    replay driver plays the folder again with the same times, parities and gaps.

    Args:
        path: The capture.
        directory: A new or empty folder.
        left_out: Takes up damaged fields, which are left out and listed in `left_out.csv`; None: they are an
            error.

    Raises:
        CaptureFileError: The file is no capture.
        StorageError: The folder cannot be written, or is not empty.
    """
    with CaptureReader(path, left_out) as reader:
        new_folder(directory)
        with (
            storage_errors(directory),
            (directory / MANIFEST).open("w", newline="", encoding="utf-8") as file,
        ):
            manifest = csv.writer(file)
            manifest.writerow(MANIFEST_COLUMNS)
            count = 0
            for field in reader.fields():
                n, time_ns, sequence, packed = field.numbered
                name, luma = f"field-{n:08d}.png", unpack(packed).luma
                write_checked(directory / name, [grey_png(luma)], png_check(luma))
                kind = packed.parity, packed.y0, packed.y_step
                manifest.writerow((n, time_ns, sequence, *kind, str(field.outcome), name))
                count += 1
            write_ledger_file(reader, directory)
            write_left_out_file(left_out, directory)
    return count


def thumbnail_png(path: Path, opened: Opened = CaptureReader) -> bytes:
    """The small picture as PNG.

    Args:
        path: The capture.
        opened: Opens the capture.

    Raises:
        CaptureFileError: The file cannot be read.
        NotFound: It has no fields.
    """
    with opened(path) as reader:
        middle = (reader.first_n or 0) + reader.field_span // 2
        field = next(reader.fields(middle, middle + _AROUND), None) or next(reader.fields(), None)
        if field is None:
            raise NotFound(f"capture {reader.meta.id} has no fields", "its ledger says what became of them")
        packed = field.numbered.packed
    return grey_png(smaller(unpack(packed).luma, SHARE // packed.y_step))


def smaller(luma: NDArray[np.uint8], rows: int) -> NDArray[np.uint8]:
    """A picture with the mean of so many rows and of `SHARE` columns in place of each; the rest is cut off.

    Targets stay visible: a white disc becomes a grey one, and is never passed over.
    """
    height, width = luma.shape[0] // rows, luma.shape[1] // SHARE
    blocks = luma[: height * rows, : width * SHARE].reshape(height, rows, width, SHARE)
    return blocks.mean(axis=(1, 3), dtype=np.float32).astype(np.uint8)


def grey_png(luma: NDArray[np.uint8]) -> bytes:
    """A PNG of grey values (rows, columns), its rows unfiltered."""
    rows, columns = luma.shape
    unfiltered = np.zeros((rows, columns + 1), np.uint8)
    unfiltered[:, 1:] = luma
    head = struct.pack(">IIBBBBB", columns, rows, _EIGHT_BITS, _GREY, 0, 0, 0)
    chunks = ((b"IHDR", head), (b"IDAT", zlib.compress(unfiltered.tobytes(), _FAST)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, content) for kind, content in chunks)


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
