"""One capture's points as a file of a data set: Parquet, with the origin of the points in its metadata."""

import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from uuid import uuid4

from grabberd.archive.export.parquet_file import parquet_batch, parquet_writer
from grabberd.archive.export.points_columns import DATASET_COLUMNS
from grabberd.archive.export.read_back import parquet_check
from grabberd.core.chain.columns import Rows
from grabberd.files.checked_file import Check, check_file
from grabberd.files.disk import storage_errors

KEY = "grabberd"


def write_dataset_file(
    part: Path,
    target: Path,
    groups: Iterable[tuple[int, Rows]],
    about: Mapping[str, Any],
    found: Callable[[int], Mapping[str, Any]] = lambda _: {},
) -> tuple[int, int]:
    """Writes a capture's points, and gives the file its name when all of them are on the disk.

    Args:
        part: Name until then, on the same disk; each process adds an ending of its own.
        target: Final name; an existing file is replaced.
        groups: Numbers of fields, and the rows of all of them; may be a generator that measures them.
        about: Capture, device, calibration, labels and further metadata.
        found: Metadata known at the end, given the number of fields.

    Returns:
        Number of fields and of points.

    Raises:
        StorageError: It cannot be written, does not read back as it was written, or its folder is gone
            because the program is ending.
    """
    constant = {
        "capture": about["capture"]["id"],
        "device": about["device"],
        "calibration": about["calibration"]["id"],
        "labels": about["labels"],
    }
    fields = points = 0
    with _own(part) as own, _opened(own) as file, parquet_writer(file, DATASET_COLUMNS) as writer:
        for count, rows in groups:
            batch = parquet_batch(DATASET_COLUMNS, {**rows, **constant})
            with storage_errors(target):
                writer.write_batch(batch)
                _tell(part, fields := fields + count)
            points += batch.num_rows
        origin = _text({**about, **found(fields), "fields": fields, "points": points})
        writer.add_key_value_metadata({KEY: origin})
        writer.close()
        with storage_errors(target):
            file.flush()
        check_file(own, _check(points, origin), target.name)
        _publish(own, target)
    _count_file(part).unlink(missing_ok=True)
    return fields, points


def _check(points: int, origin: str) -> Check:
    rows = parquet_check([column.name for column in DATASET_COLUMNS], lambda: points)

    def check(path: Path) -> str | None:
        return rows(path) or (None if _text(read_about(path)) == origin else "its origin is another one")

    return check


def read_about(path: Path) -> dict[str, Any]:
    """Origin of a file's points; empty if the file is not part of a data set.

    Raises:
        StorageError: It cannot be read now.
    """
    import pyarrow as pa  # type: ignore[import-untyped]  # noqa: PLC0415
    import pyarrow.parquet as pq  # type: ignore[import-untyped]  # noqa: PLC0415

    try:
        with storage_errors(path), path.open("rb") as file:
            found = json.loads((pq.read_metadata(file).metadata or {}).get(KEY.encode(), b"{}"))
    except (pa.ArrowInvalid, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def fields_so_far(part: Path) -> int:
    """Number of fields in a file that is being written; 0 if unknown."""
    try:
        return int(_count_file(part).read_text(encoding="ascii"))
    except (OSError, ValueError):
        return 0


@contextmanager
def _own(part: Path) -> Iterator[Path]:
    """A path that no other process uses, removed afterwards."""
    own = part.with_name(f"{part.name}-{uuid4().hex}")
    try:
        yield own
    finally:
        own.unlink(missing_ok=True)


def _opened(part: Path) -> Any:
    with storage_errors(part):
        return part.open("wb")


def _tell(part: Path, fields: int) -> None:
    """Tells the progress; fails if the folder is gone, which means that the run has ended."""
    _count_file(part).write_text(str(fields), encoding="ascii")


def _count_file(part: Path) -> Path:
    return part.with_suffix(".fields")


def _publish(part: Path, target: Path) -> None:
    with storage_errors(target):
        with part.open("rb") as file:
            os.fsync(file.fileno())  # before the rename: a name never stands for half a file
        target.parent.mkdir(parents=True, exist_ok=True)
        os.replace(part, target)


def _text(document: Mapping[str, Any]) -> str:
    return json.dumps(document, ensure_ascii=False, sort_keys=True)
