"""A data set of points on disk: Parquet files in folders by barn and day, which many programs read as it is.

    OUT/barn=BARN/day=YYYY-MM-DD/CAPTUREID-KEY.parquet   one capture's points
    OUT/_made_with/SHA256.json                           the calibrations and object models they are made with
    OUT/_scratch/…                                       what is being written; gone when nobody writes

Programs that read Parquet pass over names that begin with `_` or a dot.
"""

import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple, Self
from urllib.parse import quote, unquote

from grabberd.errors import StorageError
from grabberd.storage.capture.content_digest import document_bytes, document_sha256
from grabberd.storage.capture.directory_lock import DirectoryLock
from grabberd.storage.capture.metadata import CaptureMeta
from grabberd.storage.disk import storage_errors

SCRATCH, MADE_WITH, SUFFIX = "_scratch", "_made_with", ".parquet"
_KEY_LETTERS = 12


class Place(NamedTuple):
    """Where a capture's points belong; `key` tells captures of one id apart."""

    barn: str
    day: str
    capture: str
    key: str

    @classmethod
    def of(cls, meta: CaptureMeta, barn: str) -> Self:
        """Of a capture in a barn; the day is that of its beginning, in UTC.

        Raises:
            ValueError: its time is none.
        """
        day = datetime.fromisoformat(meta.created_utc).astimezone(UTC).date().isoformat()
        same = [meta.id, meta.created_utc, meta.start_ns, meta.device.get("name")]
        return cls(barn, day, meta.id, hashlib.sha256(document_bytes(same)).hexdigest()[:_KEY_LETTERS])

    @property
    def path(self) -> Path:
        """Below the data set's folder; what a name may not have is written as %XX, which readers undo."""
        name = f"{_visible(quote(self.capture, safe=''))}-{self.key}{SUFFIX}"
        return Path(f"barn={quote(self.barn, safe='')}") / f"day={self.day}" / name


class DataSet:
    """One folder; one program at a time measures into it."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory.absolute()
        self.made_with = self.directory / MADE_WITH
        self._lock = DirectoryLock(self.directory)

    def __enter__(self) -> Self:
        """Makes the folder, holds others off, and clears away what a killed program left.

        Raises:
            StorageError: another one measures into it, or it cannot be written.
        """
        try:
            self._lock.acquire()
        except StorageError as error:
            if error.__cause__ is not None:
                raise
            hint = "wait until it has ended, or name another --out"
            raise StorageError(f"another grabberd measures into {self.directory}", hint) from None
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
        """A folder for what is being written; who writes stops when it is gone."""
        with storage_errors(self.directory):
            home = self.directory / SCRATCH
            home.mkdir(exist_ok=True)
            return Path(tempfile.mkdtemp(dir=home))

    def clear_scratch(self) -> None:
        """Takes away what is not finished; whoever still writes it notices."""
        shutil.rmtree(self.directory / SCRATCH, ignore_errors=True)

    def keep(self, document: Any) -> str:
        """Puts a document beside the points that are made with it; returns its SHA-256, its name.

        Raises:
            StorageError: it cannot be written.
        """
        sha256 = document_sha256(document)
        final = self.made_with / f"{sha256}.json"
        if not final.exists():
            with storage_errors(final):
                # by another name first; two workers may write the same at once
                descriptor, part = tempfile.mkstemp(dir=self.made_with, prefix=".")
                with open(descriptor, "wb") as file:
                    file.write(document_bytes(document))
                Path(part).chmod(0o644)
                os.replace(part, final)
        return sha256

    def places(self) -> Iterator[Place]:
        """Of all captures that are there, by the files' names."""
        for path in self.directory.glob(f"barn=*/day=*/*{SUFFIX}"):
            barn, day = (part.partition("=")[2] for part in path.parts[-3:-1])
            capture, _, key = path.name.removesuffix(SUFFIX).rpartition("-")
            yield Place(unquote(barn), day, unquote(capture), key)


def _visible(name: str) -> str:
    """Without a first letter that makes readers pass over the file."""
    return f"%{ord(name[0]):02X}{name[1:]}" if name[:1] in {"_", "."} else name
