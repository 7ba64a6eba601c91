"""What is taken home from a capture file: points as CSV, fields as pictures."""

import csv
import io
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import cv2
import numpy as np

from grabberd.errors import CaptureFileError, StorageError
from grabberd.field import PackedField, unpack
from grabberd.reconstruction import Points
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
        times, meta = reader.times_ns(), reader.meta
        for n, points in reader.points(run):
            text = io.StringIO()
            csv.writer(text).writerows(_point_rows(n, times[n], points, meta))
            yield text.getvalue()


def _point_rows(n: int, time_ns: int, points: Points, meta: CaptureMeta) -> Iterator[tuple[object, ...]]:
    since_start = timedelta(microseconds=(time_ns - meta.start_ns) / 1000)
    utc = (datetime.fromisoformat(meta.created_utc).astimezone(UTC) + since_start).isoformat(
        timespec="milliseconds"
    )
    sigma = np.sqrt(np.diagonal(points.covariance_mm2, axis1=1, axis2=2))
    calibration = np.sqrt(np.diagonal(points.calibration_covariance_mm2, axis1=1, axis2=2))
    for i in range(len(points)):
        place = (repr(float(value)) for value in points.xyz_mm[i])
        rest = (*sigma[i], *calibration[i], points.residual_px[i], *points.image_px[i].ravel())
        yield (
            n,
            utc.replace("+00:00", "Z"),
            f"{(time_ns - meta.start_ns) / 1e9:.6f}",
            int(points.target[i]),
            *place,
            *(f"{value:.6g}" for value in rest),
        )


def field_png(path: Path, n: int) -> bytes:
    """One field as a grey PNG: its own rows where they are intact, the full height where lines are doubled.

    Raises:
        CaptureFileError, NotFound: no such file or field.
    """
    with CaptureReader(path) as reader:
        return _png(reader.field(n).numbered.packed)


def _png(packed: PackedField) -> bytes:
    good, data = cv2.imencode(".png", unpack(packed).luma, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    if not good:
        raise CaptureFileError("a field cannot be made a picture", "please report this")
    return data.tobytes()


def export_png(path: Path, directory: Path) -> int:
    """A folder of pictures, one a field, and `fields.csv`, which says what each is; returns how many.

    The folder can be played again by the replay driver, with the same times, parities and gaps.

    Raises:
        CaptureFileError: no capture.
        StorageError: the folder cannot be written, or has something in it.
    """
    _make_empty(directory)
    with CaptureReader(path) as reader, storage_errors(directory):
        with (directory / MANIFEST).open("w", newline="", encoding="utf-8") as file:
            manifest = csv.writer(file)
            manifest.writerow(MANIFEST_COLUMNS)
            count = 0
            for recorded in reader.fields():
                manifest.writerow(_write_picture(recorded, directory))
                count += 1
    return count


def _write_picture(recorded: RecordedField, directory: Path) -> tuple[object, ...]:
    n, time_ns, sequence, packed = recorded.numbered
    name = f"field-{n:08d}.png"
    (directory / name).write_bytes(_png(packed))
    return (n, time_ns, sequence, packed.parity, packed.y0, packed.y_step, str(recorded.outcome), name)


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
