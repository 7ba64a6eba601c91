"""A data set of points on disk: Parquet files in folders by barn and day, a layout that many programs read.

    OUT/barn=BARN/day=YYYY-MM-DD/CAPTUREID-KEY.parquet   one capture's points, their origin in the metadata
    OUT/_made_with/SHA256.json                           calibrations and object models of the points
    OUT/_scratch/…                                       unfinished files, which exist only while writing

Programs that read Parquet skip names that begin with `_` or a dot.
"""

import hashlib
import json
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple, Self
from urllib.parse import quote, unquote
from uuid import uuid4

from grabberd import runtime
from grabberd.archive.capture.content_digest import document_bytes, document_sha256
from grabberd.archive.capture.meta import CaptureMeta
from grabberd.archive.export.points_columns import DATASET_COLUMNS
from grabberd.archive.export.read_back import parquet_check
from grabberd.archive.export.table_files import parquet_batch, parquet_writer
from grabberd.core.chain.columns import Rows
from grabberd.errors import StorageError
from grabberd.files.checked_file import Check, check_file, text_check
from grabberd.files.disk import DirectoryLock, storage_errors

SCRATCH, MADE_WITH, SUFFIX = "_scratch", "_made_with", ".parquet"
_KEY_LETTERS = 12
KEY = "grabberd"
"""Key of the points' origin in the metadata of a file."""


class Place(NamedTuple):
    """Partition and file of a capture's points; `key` tells captures of one id apart."""

    barn: str
    day: str
    capture: str
    key: str

    @classmethod
    def of(cls, meta: CaptureMeta, barn: str) -> Self:
        """The place of a capture in a barn; its day is that of its start, in UTC.

        Raises:
            ValueError: Its time is invalid.
        """
        day = datetime.fromisoformat(meta.created_utc).astimezone(UTC).date().isoformat()
        same = [meta.id, meta.created_utc, meta.start_ns, meta.device.get("name")]
        return cls(barn, day, meta.id, hashlib.sha256(document_bytes(same)).hexdigest()[:_KEY_LETTERS])

    @property
    def path(self) -> Path:
        """Path below the data set's folder; characters that no name can have are %XX, which readers undo."""
        name = f"{_visible(quote(self.capture, safe=''))}-{self.key}{SUFFIX}"
        return Path(f"barn={quote(self.barn, safe='')}") / f"day={self.day}" / name


class DataSet:
    """The folder of a data set; one program at a time measures into it."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory.absolute()
        self.made_with = self.directory / MADE_WITH
        self._lock = DirectoryLock(self.directory)

    def __enter__(self) -> Self:
        """Creates the folder, locks it, and removes what a killed program left.

        Raises:
            StorageError: Another program is measuring into it, or it cannot be written.
        """
        try:
            self._lock.acquire()
        except StorageError as error:
            if error.__cause__ is not None:  # the disk; a held lock has no cause
                raise
            hint = "wait until it has finished, or choose another --out"
            raise StorageError(f"another grabberd is measuring into {self.directory}", hint) from None
        try:
            with storage_errors(self.directory):
                self.made_with.mkdir(exist_ok=True)
            self.clear_scratch()
        except BaseException:
            self._lock.release()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.clear_scratch()
        self._lock.release()

    def new_scratch(self) -> Path:
        """Creates a folder for unfinished files; a worker stops when it disappears."""
        with storage_errors(self.directory):
            home = self.directory / SCRATCH
            home.mkdir(exist_ok=True)
            return Path(tempfile.mkdtemp(dir=home))

    def clear_scratch(self) -> None:
        """Removes unfinished files; a worker that is still writing one notices."""
        shutil.rmtree(self.directory / SCRATCH, ignore_errors=True)

    def keep(self, document: Any) -> str:
        """Stores a document that points are made with; returns its SHA-256, which is its name.

        Raises:
            StorageError: It cannot be written, or does not read back as it was written.
        """
        sha256 = document_sha256(document)
        final = self.made_with / f"{sha256}.json"
        if not final.exists():
            with storage_errors(final):
                # under another name first: readers never see half of it, and two workers may write it at once
                descriptor, part = tempfile.mkstemp(dir=self.made_with, prefix=".")
                _write_document(descriptor, Path(part), document, final)
        return sha256

    def places(self) -> Iterator[Place]:
        """Places of all captures in the data set, read from the file names."""
        for path in self.directory.glob(f"barn=*/day=*/*{SUFFIX}"):
            barn, day = (part.partition("=")[2] for part in path.parts[-3:-1])
            capture, _, key = path.name.removesuffix(SUFFIX).rpartition("-")
            yield Place(unquote(barn), day, unquote(capture), key)


def _write_document(descriptor: int, part: Path, document: Any, final: Path) -> None:
    content = document_bytes(document)
    try:
        with open(descriptor, "wb") as file:
            file.write(content)
        check_file(part, text_check(content.decode()), final.name)
        part.chmod(0o644)  # mkstemp lets only the owner read it
        part.replace(final)
    finally:
        part.unlink(missing_ok=True)


def _visible(name: str) -> str:
    """Escapes a first character that would make readers skip the file."""
    return f"%{ord(name[0]):02X}{name[1:]}" if name[:1] in {"_", "."} else name


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
            runtime.fsync(file.fileno())  # before the rename: a name never stands for half a file
        target.parent.mkdir(parents=True, exist_ok=True)
        runtime.replace(part, target)


def _text(document: Mapping[str, Any]) -> str:
    return json.dumps(document, ensure_ascii=False, sort_keys=True)
