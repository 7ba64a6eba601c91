"""Reads contents of captures in a process of its own: several at a time, each in a thread, piece by piece.

What reading costs in processor time, memory and locks of the interpreter, it costs this process, and not the
one that takes fields from a grabber. Questions come on standard input, answers leave on standard output.
"""

import logging
import os
import pickle
import resource
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import IO, Any

from grabberd.archive.capture.kept_readers import KeptReaders
from grabberd.archive.export.channels_document import channels_json
from grabberd.archive.export.channels_export import channels_csv
from grabberd.archive.export.field_pictures import field_png
from grabberd.archive.export.points_c3d import points_c3d
from grabberd.archive.export.points_document import points_json
from grabberd.archive.export.points_export import points_csv, points_ply
from grabberd.archive.export.replay_stretches import replay_pictures, replay_points
from grabberd.archive.export.thumbnail import thumbnail_png
from grabberd.files.patience import Patience, check_patience, given_up, within
from grabberd.work.content_frames import HEAD, UNTIL, Answer, Frame, Question, is_fault, packed_error

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
