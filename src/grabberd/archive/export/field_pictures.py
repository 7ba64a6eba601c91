"""Fields of a capture as grey PNG pictures, which the replay driver can play again."""

import csv
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.digests import Damage
from grabberd.archive.capture.reader import CaptureReader, Opened
from grabberd.archive.capture.rows import RecordedField
from grabberd.archive.export.grey_png import grey_png
from grabberd.archive.export.ledger_file import write_ledger_file, write_left_out_file
from grabberd.archive.export.read_back import png_check
from grabberd.core.field import BOTTOM, PROGRESSIVE, TOP, PackedField, unpack
from grabberd.errors import InputError
from grabberd.files.checked_file import write_checked
from grabberd.files.disk import new_folder, storage_errors

MANIFEST_COLUMNS = ("n", "time_ns", "sequence", "parity", "y0", "y_step", "outcome", "file")
MANIFEST = "fields.csv"


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
        return grey_png(unpack(reader.field(n).numbered.packed).luma)


def export_png(
    path: Path, directory: Path, left_out: list[Damage] | None = None, *, woven: bool = False
) -> int:
    """Writes a folder of pictures, and `fields.csv`, which lists the fields; returns the number of pictures.

    Damaged fields and those without a signal are among them, marked; `ledger.csv` has all others as well.

    A picture is a field, or, `woven`, a frame of a top field and the bottom field after it; the rows of one
    that is not in the file stay black, and the manifest does not list it. The replay driver plays the folder
    again with the same times, parities and gaps.

    Args:
        path: The capture.
        directory: A new or empty folder.
        left_out: Takes up damaged fields, which are left out and listed in `left_out.csv`; None: they are an
            error.
        woven: Frames instead of fields.

    Raises:
        CaptureFileError: The file is no capture.
        InputError: Doubled fields cannot be woven.
        StorageError: The folder cannot be written, or is not empty.
    """
    with CaptureReader(path, left_out) as reader:
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
            write_ledger_file(reader, directory)
            write_left_out_file(left_out, directory)
    return count


def _frames(fields: Iterable[RecordedField]) -> Iterator[tuple[RecordedField, ...]]:
    """Top fields with the bottom field that follows; all others alone, such as progressive pictures."""
    frame: tuple[RecordedField, ...] = ()
    for field in fields:
        n, parity = field.numbered.n, field.numbered.packed.parity
        if frame and (parity != BOTTOM or n != frame[0].numbered.n + 1):
            yield frame
            frame = ()
        frame = (*frame, field)
        if parity != TOP:
            yield frame
            frame = ()
    if frame:
        yield frame


def _write_picture(
    picture: Sequence[RecordedField], directory: Path, what: str
) -> Iterator[tuple[object, ...]]:
    name = f"{what}-{picture[0].numbered.n:08d}.png"
    packed = [field.numbered.packed for field in picture]
    is_whole = what == "field" or packed[0].parity == PROGRESSIVE
    luma = unpack(packed[0]).luma if is_whole else _weave(packed)
    write_checked(directory / name, [grey_png(luma)], png_check(luma))
    for field in picture:
        n, time_ns, sequence, p = field.numbered
        yield (n, time_ns, sequence, p.parity, p.y0, p.y_step, str(field.outcome), name)


def _weave(fields: Sequence[PackedField]) -> NDArray[np.uint8]:
    frame = np.zeros((2 * fields[0].rows, fields[0].columns), np.uint8)
    for field in fields:
        frame[field.parity :: 2] = unpack(field).luma
    return frame
