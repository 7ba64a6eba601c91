"""A CSV file that another program appends to: lines are read as they are written."""

import codecs
import os
from io import BufferedReader
from pathlib import Path

from pydantic import Field

from grabberd.bounded_documents import MARKS, encoding_of
from grabberd.errors import Cause, DeviceAbsent, DeviceLost, DeviceRefused, StreamFailed
from grabberd.runtime import Clock
from grabberd_loggers.line_logger import LineLogger, Opened, Received
from grabberd_loggers.lines import head_of
from grabberd_loggers.options import LineOptions

_BYTES = 65_536
_BACK = 65_536
"""Bytes before the end of the file in which its last line begins."""
_MARK = 3
"""Bytes of the longest byte order mark."""
_GONE_NS = 2_000_000_000
"""Time for which a file may be missing: a program that starts a new one renames the old one first."""
ROTATED, TRUNCATED = "a new file took the place of the old one", "the file was truncated"


class CsvOptions(LineOptions):
    """All options.

    Attributes:
        path: the file.
        poll_s: time between two looks at it.
    """

    path: Path
    poll_s: float = Field(0.02, ge=0.001, le=10, allow_inf_nan=False)


class _GrowingFile:
    """The end of a file, wherever it is now."""

    driver = "csv"
    begins_anywhere = False

    def __init__(self, options: CsvOptions, clock: Clock) -> None:
        self._options, self._clock = options, clock
        self._file: BufferedReader | None = None
        self._text = _Text()
        self._header = b""
        self._missing_since_ns: int | None = None

    def open(self) -> Opened:
        path = self._options.path
        try:
            self._file = path.open("rb")
            self._text = _Text()
            head = self._text.feed(self._file.read(_BYTES))
            self._header = b"" if self._options.columns else head_of(head.decode("utf-8", "replace")).encode()
            self._go_to_last_line(self._file)
        except PermissionError as error:
            hint = "let grabberd's user read it and enter its folders"
            raise DeviceRefused(f"{path} may not be read: {error.strerror}", hint, Cause.NO_RIGHTS) from error
        except (FileNotFoundError, NotADirectoryError) as error:
            hint = "start the program that writes it, or correct its path"
            raise DeviceAbsent(f"there is no file {path}", hint) from error
        except OSError as error:
            why = f"{path} cannot be opened: {error.strerror}"
            raise DeviceRefused(why, "give the path of a file") from error
        self._missing_since_ns = None
        return Opened(path.name, {"path": str(path)})

    def receive(self, timeout_s: float) -> Received:
        assert self._file is not None
        if self._header:
            header, self._header = self._header, b""
            return Received(header)
        deadline_ns = self._clock.now_ns() + round(timeout_s * 1e9)
        while True:
            received = self._look(self._file)
            left_s = (deadline_ns - self._clock.now_ns()) / 1e9
            if received.data or received.anomalies or left_s <= 0:
                return received
            self._clock.sleep(min(self._options.poll_s, left_s))

    def close(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None
        self._header = b""

    def _go_to_last_line(self, file: BufferedReader) -> None:
        """Passes over the past: all complete lines. One that has begun will be complete later."""
        start = max(os.fstat(file.fileno()).st_size - _BACK, 0) // 2 * 2
        file.seek(start)
        place = start + self._text.last_end(file.read())
        file.seek(place)
        if place:
            self._text.begin_letter()
        else:  # the byte order mark is still to come
            self._text = _Text()

    def _look(self, file: BufferedReader) -> Received:
        try:
            data = file.read(_BYTES)
            if data:
                return Received(self._text.feed(data))
            if os.fstat(file.fileno()).st_size < file.tell():
                file.seek(0)
                return self._from_start(file, TRUNCATED)
            return self._look_for_another(file)
        except OSError as error:
            hint = "check the disk or the share it is on"
            raise StreamFailed(f"{self._options.path} cannot be read: {error.strerror}", hint) from error

    def _look_for_another(self, file: BufferedReader) -> Received:
        """Content of a new file of the same name, once the old one has been read."""
        path = self._options.path
        try:
            now = path.stat()
        except FileNotFoundError:
            now_ns = self._clock.now_ns()
            since_ns = self._missing_since_ns = self._missing_since_ns or now_ns
            if now_ns - since_ns > _GONE_NS:
                raise DeviceLost(f"{path} is gone", "grabberd goes on once it is there again") from None
            return Received()
        self._missing_since_ns = None
        old = os.fstat(file.fileno())
        if (now.st_ino, now.st_dev) == (old.st_ino, old.st_dev):
            return Received()
        self._file = path.open("rb")
        file.close()
        return self._from_start(self._file, ROTATED)

    def _from_start(self, file: BufferedReader, reason: str) -> Received:
        self._text = _Text()
        data = self._text.feed(file.read(_BYTES))
        return Received(data, ((reason, str(self._options.path)),), starts_anew=True)


class _Text:
    """The bytes of a file as UTF-8 without a byte order mark, whatever its mark says they are."""

    def __init__(self) -> None:
        self._first: bytes | None = b""
        self._encoding = "utf-8"
        self._decoder: codecs.IncrementalDecoder
        self.begin_letter()

    def feed(self, data: bytes) -> bytes:
        """The text of the next bytes; that of half a letter comes with its other half."""
        if self._first is not None:
            data = self._first + data
            if len(data) < _MARK and any(mark.startswith(data) for mark in MARKS.values()):
                self._first = data
                return b""
            self._encoding, mark = encoding_of(data)
            self._first, data = None, data[len(mark) :]
            self.begin_letter()
        return data if self._encoding == "utf-8" else self._decoder.decode(data).encode()

    def begin_letter(self) -> None:
        """Forget half a letter: the next bytes begin a whole one."""
        self._decoder = codecs.getincrementaldecoder(self._encoding)("replace")

    def last_end(self, data: bytes) -> int:
        """Place after the last end of a line, among bytes that begin with a whole letter."""
        ends = ("\n".encode(self._encoding), "\r".encode(self._encoding))
        width = len(ends[0])
        whole = range(len(data) // width * width - width, -1, -width)
        return next((place + width for place in whole if data[place : place + width] in ends), 0)


class CsvLogger(LineLogger):
    """A file that grows; `CsvOptions` lists its options."""

    options_class = CsvOptions
    source_class = _GrowingFile
