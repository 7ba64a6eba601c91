"""Reads contents of captures in a process of its own: several at a time, each in a thread, piece by piece.

What reading costs in processor time, memory and locks of the interpreter, it costs this process, and not the
one that takes fields from a grabber. Questions come on standard input, answers leave on standard output.
"""

import logging
import os
import pickle
import resource
import sys
import threading
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import IO, Any

from grabberd.errors import GrabberdError
from grabberd.storage.content_frames import HEAD, UNTIL, Answer, Frame, Question, packed_error
from grabberd.storage.export.field_pictures import field_png
from grabberd.storage.export.points_document import points_json
from grabberd.storage.export.points_export import points_csv, points_ply
from grabberd.storage.patience import Patience, check_patience, within

log = logging.getLogger(__name__)

MEMORY_BYTES = 1_000_000_000
"""Of private data, for the process: the largest answer, 200 000 points as JSON, takes a tenth of it."""
NICENESS = 10
PIECE_BYTES = 65_536
PROGRAM = f"from {__name__} import CONTENTS, main; main(CONTENTS)"
CONTENTS: dict[str, Callable[..., Any]] = {
    read.__name__: read for read in (points_json, points_csv, points_ply, field_png)
}
"""What can be read, by name: as bytes, or as a generator of pieces."""


class _Reading:
    """One reading in this process; `lock` is held by the thread that works at it."""

    def __init__(self, read: Callable[[], Any], until_s: float) -> None:
        self.lock = threading.Lock()
        self._patience = Patience(until_s)
        self._given_up = False
        self._read = read
        self._pieces: Generator[Any, None, None] | None = None

    def begin(self) -> tuple[Answer, bytes]:
        """Reads all, or begins with what comes in pieces."""
        with within(self._patience):
            check_patience("what was asked for")  # it may have waited for a thread for too long
            found = self._read()
        if isinstance(found, bytes):
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
        """Ends it."""
        with self.lock:
            if self._pieces is not None:
                self._pieces.close()


def _of_some_size(pieces: Generator[Any, None, None]) -> Iterator[bytes]:
    """Pieces up to `PIECE_BYTES`: those of one field each would be asked for, and sent, one by one."""
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
        self._pool.shutdown()

    def _take(self, question: Frame) -> None:
        number = question.number
        if question.kind == Question.READ:
            name, arguments, until_s = pickle.loads(question.content)  # noqa: S301 - from the daemon itself
            reading = _Reading(partial(self._contents[name], *arguments), until_s)
            self._readings[number] = reading
            self._pool.submit(self._answer, number, reading, reading.begin)
        elif question.kind == Question.GIVE_UP:
            self._give_up(number)
        elif number in self._readings:
            reading = self._readings[number]
            (until_s,) = UNTIL.unpack(question.content)
            self._pool.submit(self._answer, number, reading, partial(reading.next, until_s))

    def _give_up(self, number: int) -> None:
        if reading := self._readings.pop(number, None):
            reading.give_up()
            self._pool.submit(reading.close)

    def _answer(self, number: int, reading: _Reading, step: Callable[[], tuple[Answer, bytes]]) -> None:
        with reading.lock:
            try:
                kind, content = step()
            except Exception as error:
                if not isinstance(error, GrabberdError):
                    log.exception("reading a content failed")
                kind, content = Answer.ERROR, packed_error(error)
        if kind not in (Answer.BEGUN, Answer.PIECE):
            self._readings.pop(number, None)
        with self._writing:
            self._output.write(Frame(number, kind, content).packed())
            self._output.flush()


def main(contents: Mapping[str, Callable[..., Any]]) -> None:
    """Answers on standard input and output, and ends with whoever asks. Argument: number of threads."""
    os.nice(NICENESS)
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY_BYTES, MEMORY_BYTES))
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a library prints is no answer
    ContentServer(contents, int(sys.argv[1]), output).serve(sys.stdin.buffer)
