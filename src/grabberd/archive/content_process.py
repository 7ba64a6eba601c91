"""Contents of captures, read in a process of its own: several at a time, each in a thread, piece by piece.

What reading costs in processor time, memory and locks of the interpreter, it costs this process, and not the
one that takes fields from a grabber. Questions come on standard input, answers leave on standard output.
Readers of sealed captures stay open between two questions: a page asks for one field after the other, and to
open the file, to check that it is a capture and to decode half a second of fields takes far longer than that.
"""

import logging
import os
import pickle
import resource
import signal
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import IO, Any, NamedTuple

from grabberd.archive.capture.meta import SEALED
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.schema import named_now, reading_errors
from grabberd.archive.export.c3d_file import points_c3d
from grabberd.archive.export.channels_export import channels_csv
from grabberd.archive.export.field_pictures import field_png, thumbnail_png
from grabberd.archive.export.page_documents import channels_json, points_json
from grabberd.archive.export.points_export import points_csv, points_ply
from grabberd.archive.export.replay_stretches import replay_pictures, replay_points
from grabberd.archive.guarded_database import read_header
from grabberd.files.patience import Patience, check_patience, given_up, within
from grabberd.work.content_frames import HEAD, UNTIL, Answer, Frame, Question, is_fault, packed_error

MOST = 4
"""Captures that are kept open; each may hold a group of pictures and one of points, some ten megabytes."""
KEPT_S = 5.0
"""Time after its last use until a capture is closed: the room of a deleted one is free only then."""


class _Identity(NamedTuple):
    """Signs of a file of which one changes when it is replaced, written or given other rights."""

    device: int
    inode: int
    size: int
    modified_ns: int
    changed_ns: int

    @classmethod
    def of(cls, path: Path) -> "_Identity":
        """The identity of the file at a path, or of a link itself."""
        found = path.lstat()
        return cls(found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns)


class _Kept(NamedTuple):
    """A reader that nobody uses at present."""

    reader: CaptureReader
    identity: _Identity
    until_s: float


class KeptReaders:
    """Gives readers of captures, one user at a time, and keeps those of sealed ones; any thread may call.

    Args:
        now_s: Source of monotonic time.
    """

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._lock = threading.Lock()
        self._kept: dict[Path, _Kept] = {}
        self._timer: threading.Timer | None = None

    @contextmanager
    def opened(self, path: Path) -> Iterator[CaptureReader]:
        """A reader for the duration of the block: the one that was kept, if the file is what it was then.

        Raises:
            CaptureFileError, StorageError, ReadingGivenUp: As `CaptureReader` does.
        """
        with reading_errors(path):
            reader, identity = self._found(path)
        try:
            yield reader
        except BaseException:  # it may be in the middle of a statement
            reader.close()
            raise
        self._keep(reader, identity)

    def close_old(self) -> None:
        """Closes what nobody has used for `KEPT_S`; a thread calls it as long as there is anything."""
        self._close_until(self._now_s())

    def close(self) -> None:
        """Closes all that is kept."""
        self._close_until(float("inf"))

    def _found(self, path: Path) -> tuple[CaptureReader, _Identity]:
        """Takes a reader; of a capture that has been sealed since its path was looked up, by its name now."""
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
                # What SQLite would find beside the file, it finds now and not when the file was opened.
                read_header(path)
                return kept.reader, identity
        except BaseException:
            if kept is not None:
                kept.reader.close()
            raise
        if kept is not None:
            kept.reader.close()
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
            if not self._will_look():
                closed += self._kept.values()
                self._kept.clear()
        for one in filter(None, closed):
            one.reader.close()

    def _will_look(self) -> bool:
        """True if a thread will close what is old; False if the computer has no thread left to give."""
        if self._timer is None:
            oldest_s = min(kept.until_s for kept in self._kept.values())
            timer = threading.Timer(max(0.0, oldest_s - self._now_s()), self._look)
            timer.daemon = True
            try:
                timer.start()
            except RuntimeError:
                return False
            self._timer = timer
        return True

    def _look(self) -> None:
        self.close_old()
        with self._lock:
            self._timer = None
            closed: list[_Kept] = []
            if self._kept and not self._will_look():
                closed = list(self._kept.values())
                self._kept.clear()
        for one in closed:
            one.reader.close()

    def _close_until(self, now_s: float) -> None:
        with self._lock:
            old = [path for path, kept in self._kept.items() if kept.until_s <= now_s]
            closed = [self._kept.pop(path) for path in old]
        for one in closed:
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

MEMORY_BYTES = 700_000_000
"""Of private data, for the process: eight of the largest answers, 200 000 points as JSON of 50 MB each, and
the stacks of as many threads."""
NICENESS = 10
"""Linux weighs it 110 against the daemon's 1024."""
LEFT_S = 5.0
"""Time for readings to end once nobody asks any more."""
PIECE_BYTES = 65_536
"""Least size of a piece, so that few are asked for; a field's text has some ten thousand bytes."""
NICED = f"import os; os.nice({NICENESS})"
"""Begins the program: to import the rest takes half a second of processor time."""
PROGRAM = f"{NICED}; from {__name__} import CONTENTS, main; main(CONTENTS)"
_KEPT = KeptReaders()
_LEAFED: tuple[Callable[..., Any], ...] = (
    *(points_json, field_png, thumbnail_png, channels_json),
    *(replay_points, replay_pictures),
)
CONTENTS: dict[str, Callable[..., Any]] = {
    **{read.__name__: partial(read, opened=_KEPT.opened) for read in _LEAFED},
    **{read.__name__: read for read in (points_csv, points_ply, points_c3d, channels_csv)},
}
"""What can be read, by name: as bytes, or as a generator of pieces."""
Step = Callable[[], tuple[Answer, bytes | bytearray]]


class _Reading:
    """One reading in this process.

    Attributes:
        lock: Held by the thread that works at it.
        is_asked: True while an answer is waited for whose step has not begun.
    """

    def __init__(self, read: Callable[[], Any], until_s: float) -> None:
        self.lock = threading.Lock()
        self.is_asked = False
        self._patience = Patience(until_s)
        self._given_up = False
        self._read = read
        self._pieces: Generator[Any, None, None] | None = None

    def begin(self) -> tuple[Answer, bytes | bytearray]:
        """Reads all, or begins with what comes in pieces."""
        with within(self._patience):
            check_patience("what was asked for")  # it may have waited for a thread for too long
            found = self._read()
        if isinstance(found, bytes | bytearray):
            return Answer.WHOLE, found
        self._pieces = found
        return Answer.BEGUN, b""

    def next(self, until_s: float) -> tuple[Answer, bytes]:
        """The next piece, within a new patience."""
        assert self._pieces is not None
        self._patience = Patience(until_s)
        if self._given_up:  # since it was asked for
            self._patience.give_up()
        with within(self._patience):
            piece = b"".join(_of_some_size(self._pieces))
        return (Answer.PIECE, piece) if piece else (Answer.END, b"")

    def give_up(self) -> None:
        """Ends the step that goes on, from any thread."""
        self._given_up = True
        self._patience.give_up()

    def close(self) -> None:
        """Closes the file of what comes in pieces."""
        with self.lock:
            if self._pieces is not None:
                self._pieces.close()


def _of_some_size(pieces: Generator[Any, None, None]) -> Iterator[bytes]:
    """Pieces of one field each, until they have `PIECE_BYTES` together."""
    count = 0
    for piece in pieces:
        check_patience("what was asked for")
        content = piece.encode() if isinstance(piece, str) else piece
        yield content
        count += len(content)
        if count >= PIECE_BYTES:
            return


class ContentServer:
    """Answers questions about contents.

    Args:
        contents: What can be read, by name.
        threads: Number of readings that go on at a time.
        output: Where answers are written.
    """

    def __init__(self, contents: Mapping[str, Callable[..., Any]], threads: int, output: IO[bytes]) -> None:
        self._contents = contents
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="reading")
        self._output = output
        self._writing = threading.Lock()
        self._readings: dict[int, _Reading] = {}

    def serve(self, questions: IO[bytes]) -> None:
        """Answers until there are no more questions, and gives up what goes on then."""
        while len(head := questions.read(HEAD.size)) == HEAD.size:
            number, kind, length = HEAD.unpack(head)
            self._take(Frame(number, kind, questions.read(length)))
        for number in tuple(self._readings):
            self._give_up(number)

    def close(self) -> None:
        """Waits until what was given up has ended."""
        self._pool.shutdown()

    def _take(self, question: Frame) -> None:
        try:
            if question.kind == Question.GIVE_UP:
                self._give_up(question.number)
            elif question.kind == Question.READ:
                self._begin(question)
            else:
                self._go_on(question)
        except Exception as error:  # no further thread, or no memory for what is asked
            self._readings.pop(question.number, None)
            self._tell(question.number, *_failed(error))

    def _begin(self, question: Frame) -> None:
        name, arguments, until_s = pickle.loads(question.content)  # noqa: S301 - from the daemon itself
        reading = _Reading(partial(self._contents[name], *arguments), until_s)
        self._readings[question.number] = reading
        self._submit(question.number, reading, reading.begin)

    def _go_on(self, question: Frame) -> None:
        reading = self._readings.get(question.number)
        if reading is None:  # it has failed, and was told so
            self._tell(question.number, *_failed(given_up("what was asked for")))
            return
        (until_s,) = UNTIL.unpack(question.content)
        self._submit(question.number, reading, partial(reading.next, until_s))

    def _submit(self, number: int, reading: _Reading, step: Step) -> None:
        reading.is_asked = True
        self._pool.submit(self._answer, number, reading, step)

    def _give_up(self, number: int) -> None:
        reading = self._readings.pop(number, None)
        if reading is None:
            return
        reading.give_up()
        # A step that has begun answers when it ends. One that waits for a thread is answered now: a process
        # that does not answer is taken for one that hangs.
        if reading.lock.acquire(blocking=False):
            waits, reading.is_asked = reading.is_asked, False
            reading.lock.release()
            if waits:
                self._tell(number, *_failed(given_up("what was asked for")))
        self._pool.submit(reading.close)

    def _answer(self, number: int, reading: _Reading, step: Step) -> None:
        with reading.lock:
            if not reading.is_asked:  # it was given up, and answered
                return
            reading.is_asked = False
            try:
                kind, content = step()
            except Exception as error:
                kind, content = _failed(error)
        if kind not in (Answer.BEGUN, Answer.PIECE):
            self._readings.pop(number, None)
        self._tell(number, kind, content)

    def _tell(self, number: int, kind: Answer, content: bytes | bytearray) -> None:
        with self._writing:
            self._output.write(HEAD.pack(number, kind, len(content)))
            self._output.write(content)
            self._output.flush()


def _failed(error: Exception) -> tuple[Answer, bytes]:
    content = packed_error(error)
    if is_fault(content):
        log.error("reading a content failed", exc_info=error)
    return Answer.ERROR, content


def main(contents: Mapping[str, Callable[..., Any]]) -> None:
    """Answers on standard input and output, and ends with whoever asks. Argument: number of threads."""
    # They are meant for the daemon, which closes standard input when it has answered its last request.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY_BYTES, MEMORY_BYTES))
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a library prints is no answer
    server = ContentServer(contents, int(sys.argv[1]), output)
    server.serve(sys.stdin.buffer)
    # Whoever asked may be gone: a thread that hangs on a disk must not keep this process.
    end = threading.Timer(LEFT_S, os._exit, (1,))
    end.daemon = True
    end.start()
    server.close()
