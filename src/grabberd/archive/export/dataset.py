"""A data set of points on disk: Parquet files in folders by barn and day, a layout that many programs read.

    OUT/barn=BARN/day=YYYY-MM-DD/CAPTUREID-KEY.parquet   one capture's points
    OUT/_made_with/SHA256.json                           calibrations and object models of the points
    OUT/_scratch/…                                       unfinished files, which exist only while writing

Programs that read Parquet skip names that begin with `_` or a dot.
"""

import hashlib
import shutil
import tempfile
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple, Self
from urllib.parse import quote, unquote

from grabberd.archive.capture.content_digest import document_bytes, document_sha256
from grabberd.archive.capture.meta import CaptureMeta
from grabberd.errors import StorageError
from grabberd.files.checked_file import check_file
from grabberd.files.directory_lock import DirectoryLock
from grabberd.files.disk import storage_errors
from grabberd.files.text_check import text_check

SCRATCH, MADE_WITH, SUFFIX = "_scratch", "_made_with", ".parquet"
_KEY_LETTERS = 12


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
