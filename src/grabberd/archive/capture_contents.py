"""Contents of captures as read by a separate process, or written by one: as a whole or in pieces.

Readers of sealed captures stay open between two requests: a page requests one field after the other, and
opening the file, checking it and decoding half a second of fields takes far longer than reading one.

pyarrow and scipy.io are large, slow to import and keep the interpreter to themselves while they write, so
points as Parquet or as a MAT-file come from a niced process of their own.
"""

import logging
import os
import tempfile
import threading  # noqa: TID251 - its semaphore waits for nobody
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from grabberd import runtime
from grabberd.archive.capture.meta import SEALED
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.schema import named_now, reading_errors
from grabberd.archive.catalogue.capture_documents import ledger_json, run_json
from grabberd.archive.export.c3d_file import points_c3d
from grabberd.archive.export.channels_export import channels_csv
from grabberd.archive.export.field_pictures import field_png, thumbnail_png
from grabberd.archive.export.mat_file import check_stream_size, points_mat
from grabberd.archive.export.page_documents import channels_json, points_json, replay_pictures, replay_points
from grabberd.archive.export.points_export import open_run, points_csv, points_parquet, points_ply
from grabberd.archive.export.table_files import check_parquet
from grabberd.archive.guarded_database import read_header
from grabberd.errors import ReadingGivenUp, StorageError
from grabberd.work.child import Limits
from grabberd.work.process import NoAnswer, Process

MOST = 4
"""Maximum number of open captures; each may hold a group of pictures and one of points, some 10 MB."""
KEPT_S = 5.0
"""Time after its last use until a capture is closed; until then, a deleted one still occupies the disk."""


class _Identity(NamedTuple):
    """Properties of a file; at least one changes when it is replaced or written, or its mode is changed."""

    device: int
    inode: int
    size: int
    modified_ns: int
    changed_ns: int

    @classmethod
    def of(cls, path: Path) -> "_Identity":
        """The identity of the file at a path; of a link, its own."""
        found = path.lstat()
        return cls(found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns)


class _Kept(NamedTuple):
    """A reader that is not in use."""

    reader: CaptureReader
    identity: _Identity
    until_s: float


class KeptReaders:
    """A cache of readers of sealed captures, each for one user at a time; any thread may call.

    Args:
        now_s: Source of monotonic time.
    """

    def __init__(self, now_s: Callable[[], float] = runtime.monotonic) -> None:
        self._now_s = now_s
        self._lock = runtime.lock()
        self._kept: dict[Path, _Kept] = {}
        self._timer: runtime.Timer | None = None

    @contextmanager
    def opened(self, path: Path) -> Iterator[CaptureReader]:
        """A reader for the duration of the block; a cached one if the file has not changed.

        Raises:
            CaptureFileError, StorageError, ReadingGivenUp: See `CaptureReader`.
        """
        with reading_errors(path):
            reader, identity = self._found(path)
        try:
            yield reader
        except BaseException:  # a statement may still be open
            reader.close()
            raise
        self._keep(reader, identity)

    def close_old(self) -> None:
        """Closes readers that have been unused for `KEPT_S`; called by a timer."""
        self._close_until(self._now_s())

    def close(self) -> None:
        """Closes all cached readers."""
        self._close_until(float("inf"))

    def _found(self, path: Path) -> tuple[CaptureReader, _Identity]:
        """Takes a reader, under the final name if the capture was sealed after its path was looked up."""
        try:
            return self._taken(path)
        except FileNotFoundError:
            sealed = named_now(path)
            if sealed == path:
                raise
            return self._taken(sealed)

    def _taken(self, path: Path) -> tuple[CaptureReader, _Identity]:
        with self._lock:
            kept = self._kept.pop(path, None)
        try:
            identity = _Identity.of(path)
            if kept is not None and kept.identity == identity:
                # Checked again: SQLite would use a journal that has appeared beside the file meanwhile.
                read_header(path)
                return kept.reader, identity
        except BaseException:
            _close([kept])
            raise
        _close([kept])
        return _new(path), identity

    def _keep(self, reader: CaptureReader, identity: _Identity) -> None:
        if reader.meta.state != SEALED or not _is_still(reader.path, identity):
            reader.close()
            return
        with self._lock:
            closed = [self._kept.pop(reader.path, None)]
            self._kept[reader.path] = _Kept(reader, identity, self._now_s() + KEPT_S)
            if len(self._kept) > MOST:
                closed.append(self._kept.pop(next(iter(self._kept))))
            closed += self._look_later()
        _close(closed)

    def _look_later(self) -> list[_Kept]:
        """Makes sure that a timer will close old readers; returns all if no thread can be started."""
        if self._timer is None and self._kept:
            oldest_s = min(kept.until_s for kept in self._kept.values())
            timer = runtime.Timer(max(0.0, oldest_s - self._now_s()), self._look)
            timer.daemon = True
            try:
                timer.start()
            except RuntimeError:
                closed = list(self._kept.values())
                self._kept.clear()
                return closed
            self._timer = timer
        return []

    def _look(self) -> None:
        self.close_old()
        with self._lock:
            self._timer = None
            closed = self._look_later()
        _close(closed)

    def _close_until(self, now_s: float) -> None:
        with self._lock:
            old = [path for path, kept in self._kept.items() if kept.until_s <= now_s]
            closed = [self._kept.pop(path) for path in old]
        _close(closed)


def _close(closed: Iterable[_Kept | None]) -> None:
    for one in filter(None, closed):
        one.reader.close()


def _new(path: Path) -> CaptureReader:
    reader = CaptureReader(path)
    if reader.meta.state == SEALED:
        reader.content.keep_groups()
    return reader


def _is_still(path: Path, identity: _Identity) -> bool:
    try:
        return _Identity.of(path) == identity
    except OSError:
        return False


log = logging.getLogger(__name__)

LIMITS = Limits(niceness=10, data_bytes=700_000_000)
"""Limits of the process: memory for eight of the largest answers, 200 000 points as JSON of 50 MB each, twice
as many as are made at a time unless the configuration asks for more."""
_KEPT = KeptReaders()
_RANDOM_ACCESS: tuple[Callable[..., Any], ...] = (
    *(points_json, field_png, thumbnail_png, channels_json),
    *(replay_points, replay_pictures, ledger_json, run_json),
)
CONTENTS: dict[str, Callable[..., Any]] = {
    **{read.__name__: partial(read, opened=_KEPT.opened) for read in _RANDOM_ACCESS},
    **{read.__name__: read for read in (points_csv, points_ply, points_c3d, channels_csv)},
}
"""All contents by name: functions that return bytes, or a generator of pieces."""


def read(name: str, *arguments: Any) -> Any:
    """Reads one of `CONTENTS`; called in the process. What is large is given piece by piece."""
    found = CONTENTS[name](*arguments)
    is_large = isinstance(found, bytes | bytearray) and len(found) > LARGEST_WHOLE
    return _pieces_of(found) if is_large else found


def _pieces_of(whole: bytes | bytearray) -> Generator[bytes, None, None]:
    for first in range(0, len(whole), CHUNK_BYTES):
        yield bytes(whole[first : first + CHUNK_BYTES])


LARGEST_WHOLE = 1 << 20
"""Largest answer in bytes that the daemon takes as a whole."""
CHUNK_BYTES = 65_536
STREAM_LIMITS = Limits(niceness=10)
"""Without a limit of memory: Parquet is written in groups of rows, and a MAT-file's size is known before."""
PARQUET, MAT = "Parquet", "MAT-file"
MOST_WRITING = 2
"""Processes that write such files at a time: each takes more memory than many other answers together."""
_WRITING = threading.BoundedSemaphore(MOST_WRITING)


def parquet_stream(path: Path, run: int | None = None) -> Generator[bytes, None, None]:
    """A Parquet file as it is written; errors are raised at once, before the first bytes.

    Raises:
        CaptureFileError, NotFound, ExtraMissing: See `points_parquet`.
    """
    check_parquet()
    reader, number = open_run(path, run)
    reader.close()
    return _from_child(PARQUET, path, number)


def mat_stream(path: Path, run: int | None = None) -> Generator[bytes, None, None]:
    """A MAT-file, once it has been written; errors are raised at once, before the first bytes.

    Raises:
        CaptureFileError, NotFound: See `points_mat`.
        InputError: It would take too much of the daemon's memory.
    """
    reader, number = open_run(path, run)
    with reader:
        check_stream_size(reader, number)
    return _from_child(MAT, path, number)


def _from_child(kind: str, path: Path, run: int) -> Generator[bytes, None, None]:
    if not _WRITING.acquire(blocking=False):
        hint = "try again in a moment, or take the points as CSV"
        raise ReadingGivenUp(f"{MOST_WRITING} files are being written as {PARQUET} or {MAT} already", hint)
    try:
        with closing(Process(STREAM_LIMITS)) as process:
            yield from process.stream(
                f"{__name__}:{'parquet' if kind == PARQUET else 'mat'}_pieces", path, run
            )
    except (NoAnswer, RuntimeError) as error:
        # The status line is long sent: only an exception cuts the answer off, and keeps it from passing for
        # whole.
        raise StorageError(f"{path.name} could not be written as {kind}", "the log says why") from error
    finally:
        _WRITING.release()


def parquet_pieces(path: Path, run: int) -> Generator[bytes, None, None]:
    """A capture's points as Parquet while it is written; called in the process."""
    reading, writing = os.pipe()

    def write() -> None:
        with os.fdopen(writing, "wb") as output:
            points_parquet(path, run, output)

    with runtime.pool(1) as pool, os.fdopen(reading, "rb", buffering=0) as written:
        result = pool.submit(write)
        while chunk := written.read(CHUNK_BYTES):
            yield chunk
        result.result()


def mat_pieces(path: Path, run: int) -> Generator[bytes, None, None]:
    """A capture's points as a MAT-file, once it is written; called in the process."""
    # The sizes of a MAT-file are put in once they are known, which a pipe cannot do.
    with tempfile.TemporaryFile() as whole:
        points_mat(path, run, whole)
        whole.seek(0)
        while chunk := whole.read(CHUNK_BYTES):
            yield chunk
