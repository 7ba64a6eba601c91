"""What is taken home from a capture file: points as CSV, fields as pictures."""

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from grabberd.errors import InputError, StorageError
from grabberd.field import BOTTOM, TOP, PackedField, unpack
from grabberd.reconstruction.points import Points
from grabberd.storage.meta import CaptureMeta
from grabberd.storage.reader import CaptureReader, RecordedField
from grabberd.storage.schema import storage_errors

POINT_COLUMNS = (
    "n",
    "time_utc",
    "time_s",
    "target",
    "x_mm",
    "y_mm",
    "z_mm",
    "sigma_x_mm",
    "sigma_y_mm",
    "sigma_z_mm",
    "calibration_sigma_x_mm",
    "calibration_sigma_y_mm",
    "calibration_sigma_z_mm",
    "residual_px",
    "left_x_px",
    "left_y_px",
    "right_x_px",
    "right_y_px",
)
MANIFEST_COLUMNS = ("n", "time_ns", "sequence", "parity", "y0", "y_step", "outcome", "file")
MANIFEST = "fields.csv"


def points_csv(path: Path, run: int | None = None) -> Iterator[str]:
    """Text of a CSV file, some fields at a time; the errors are raised at once, before the first text.

    Raises:
        CaptureFileError, NotFound: no such file or run.
    """
    reader = CaptureReader(path)
    try:
        number = reader.run(run).run
    except Exception:
        reader.close()
        raise
    return _points_text(reader, number)


def _points_text(reader: CaptureReader, run: int) -> Iterator[str]:
    with reader:
        yield ",".join(POINT_COLUMNS) + "\r\n"
        first_ns, meta = reader.first_time_ns or 0, reader.meta
        for n, time_ns, points in reader.timed_points(run):
            text = io.StringIO()
            when = (n, _utc(time_ns, meta), f"{(time_ns - first_ns) / 1e9:.6f}")
            csv.writer(text).writerows((*when, *row) for row in _point_rows(points))
            yield text.getvalue()


def _utc(time_ns: int, meta: CaptureMeta) -> str:
    """ISO 8601 with milliseconds; empty for a recording played again, whose clock has passed."""
    if not meta.device.get("stream", {}).get("live", True):
        return ""
    moment = datetime.fromisoformat(meta.created_utc) + timedelta(
        microseconds=(time_ns - meta.start_ns) / 1000
    )
    return moment.astimezone(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _point_rows(points: Points) -> Iterator[tuple[object, ...]]:
    sigma = np.sqrt(np.diagonal(points.covariance_mm2, axis1=1, axis2=2))
    calibration = np.sqrt(np.diagonal(points.calibration_covariance_mm2, axis1=1, axis2=2))
    for i in range(len(points)):
        place = (repr(float(value)) for value in points.xyz_mm[i])
        rest = (*sigma[i], *calibration[i], points.residual_px[i], *points.image_px[i].ravel())
        yield (int(points.target[i]), *place, *(f"{value:.6g}" for value in rest))


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
        _make_empty(directory)
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
    _make_empty(directory)
    rows = -1
    with (
        storage_errors(directory),
        (directory / "points.csv").open("w", newline="", encoding="utf-8") as file,
    ):
        for part in text:
            file.write(part)
            rows += part.count("\n")
    return rows


def _make_empty(directory: Path) -> None:
    with storage_errors(directory):
        directory.mkdir(parents=True, exist_ok=True)
        if any(directory.iterdir()):
            raise StorageError(
                f"the folder {directory} is not empty", "name a new one; nothing is overwritten"
            )
