"""A process that runs functions for another one, seen from inside; `process` is the other side.

Several calls go on at a time, each in a thread, and what is long comes piece by piece. What a function costs
in processor time, memory and locks of the interpreter, it costs this process, and not the one that takes
fields from a grabber. Questions come on standard input, answers leave on standard output.
"""

import ctypes
import json
import logging
import os
import pickle
import pkgutil
import resource
import select
import signal
import threading
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import IO, Any, NoReturn

from grabberd.files.reading import Patience, check_patience, given_up, within
from grabberd.work.frames import HEAD, NUMBER, Answer, Call, Frame, Question, is_fault, packed_error

log = logging.getLogger(__name__)

LEFT_S = 5.0
"""Time for calls to end once nobody asks any more."""
PIECE_BYTES = 65_536
"""Least size of a piece, so that few are asked for; a field's text has some ten thousand bytes."""
_PR_SET_PDEATHSIG = 1
_WHAT = "what was asked for"

Step = Callable[[], tuple[Answer, bytes | bytearray]]


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of what a process may take.

    Attributes:
        niceness: Added to that of its parent; with 10, Linux weighs it 110 against the daemon's 1024.
        is_last: True if it works, and reads the disk, only when nobody else wants to.
        data_bytes: Most private data; addresses that libraries and threads only reserve do not count.
        address_bytes: Most address space, for who reads what may be hostile.
        threads: Number of calls that go on at a time.
        idle_s: Time without a call after which it ends by itself; None: it waits for ever.
        parent: Id of the process that it must not outlive, not even amid a call; 0: it finds out by itself.
    """

    niceness: int = 0
    is_last: bool = False
    data_bytes: int = resource.RLIM_INFINITY
    address_bytes: int = resource.RLIM_INFINITY
    threads: int = 1
    idle_s: float | None = None
    parent: int = 0

    def apply(self) -> None:
        """Puts them in force in this process."""
        if self.parent:
            with suppress(AttributeError, OSError):
                ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
            if os.getppid() != self.parent:  # it has ended before that
                os._exit(1)
        if self.is_last:
            # It also puts reading behind everybody else's, where the disk's scheduler knows of priorities.
            os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
        resource.setrlimit(resource.RLIMIT_DATA, (self.data_bytes, self.data_bytes))
        resource.setrlimit(resource.RLIMIT_AS, (self.address_bytes, self.address_bytes))


class _Running:
    """A call in this process.

    Attributes:
        lock: Held by the thread that works at it.
        is_asked: True while an answer is waited for whose step has not begun.
    """

    def __init__(self, run: Callable[[], Any], until_s: float | None) -> None:
        self.lock = threading.Lock()
        self.is_asked = False
        self._patience = Patience(until_s)
        self._given_up = False
        self._run = run
        self._pieces: Generator[Any, None, None] | None = None

    def begin(self) -> tuple[Answer, bytes | bytearray]:
        """Computes all, or begins with what comes in pieces."""
        with within(self._patience):
            check_patience(_WHAT)  # it may have waited for a thread for too long
            found = self._run()
        if isinstance(found, bytes | bytearray):
            return Answer.WHOLE, found
        if isinstance(found, Generator):
            self._pieces = found
            return Answer.BEGUN, b""
        return Answer.VALUE, json.dumps(found).encode()

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
        check_patience(_WHAT)
        content = piece.encode() if isinstance(piece, str) else piece
        yield content
        count += len(content)
        if count >= PIECE_BYTES:
            return


class Child:
    """Answers calls of functions.

    Args:
        threads: Number of calls that go on at a time.
        output: Where answers are written.
        resolve: The function of a name.
    """

    def __init__(
        self,
        threads: int,
        output: IO[bytes],
        resolve: Callable[[str], Callable[..., Any]] = pkgutil.resolve_name,
    ) -> None:
        self._resolve = resolve
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="call")
        self._output = output
        self._writing = threading.Lock()
        self._calls: dict[int, _Running] = {}

    def serve(self, questions: IO[bytes], idle_s: float | None = None) -> None:
        """Answers until there are no more questions, and gives up what goes on then.

        Args:
            questions: Unbuffered.
            idle_s: See `Limits`.
        """
        self._tell(0, Answer.READY, b"")
        while self._is_asked(questions, idle_s) and (head := _read(questions, HEAD.size)):
            number, kind, length = HEAD.unpack(head)
            self._take(Frame(number, kind, _read(questions, length)))
        for number in tuple(self._calls):
            self._give_up(number)

    def close(self) -> None:
        """Waits until what was given up has ended."""
        self._pool.shutdown()

    def _is_asked(self, questions: IO[bytes], idle_s: float | None) -> bool:
        while not select.select([questions], [], [], idle_s)[0]:
            if not self._calls:
                return False
        return True

    def _take(self, question: Frame) -> None:
        try:
            if question.kind == Question.GIVE_UP:
                self._give_up(question.number)
            elif question.kind == Question.CALL:
                self._begin(question.number, pickle.loads(question.content))  # noqa: S301 - from the daemon itself
            else:
                self._go_on(question)
        except Exception as error:  # no further thread, no memory for what is asked, or no such function
            self._calls.pop(question.number, None)
            self._tell(question.number, *_failed(error))

    def _begin(self, number: int, call: Call) -> None:
        reports = {"progress": partial(self._report, number)} if call.reports else {}

        def run() -> Any:  # which imports what the function needs, in the thread and within the patience
            return self._resolve(call.function)(*call.arguments, **reports)

        running = self._calls[number] = _Running(run, call.until_s)
        self._submit(number, running, running.begin)

    def _report(self, number: int, share: float) -> None:
        self._tell(number, Answer.PROGRESS, NUMBER.pack(share))

    def _go_on(self, question: Frame) -> None:
        running = self._calls.get(question.number)
        if running is None:  # it has failed, and its failure was the answer
            self._tell(question.number, *_failed(given_up(_WHAT)))
            return
        (until_s,) = NUMBER.unpack(question.content)
        self._submit(question.number, running, partial(running.next, until_s))

    def _submit(self, number: int, running: _Running, step: Step) -> None:
        running.is_asked = True
        self._pool.submit(self._answer, number, running, step)

    def _give_up(self, number: int) -> None:
        running = self._calls.pop(number, None)
        if running is None:
            return
        running.give_up()
        # A step that has begun answers when it ends. One that waits for a thread is answered now: a process
        # that does not answer is taken for one that hangs.
        if running.lock.acquire(blocking=False):
            waits, running.is_asked = running.is_asked, False
            running.lock.release()
            if waits:
                self._tell(number, *_failed(given_up(_WHAT)))
        self._pool.submit(running.close)

    def _answer(self, number: int, running: _Running, step: Step) -> None:
        with running.lock:
            if not running.is_asked:  # it was given up, and answered
                return
            running.is_asked = False
            try:
                kind, content = step()
            except Exception as error:
                kind, content = _failed(error)
        if kind not in (Answer.BEGUN, Answer.PIECE):
            self._calls.pop(number, None)
        try:
            self._tell(number, kind, content)
        except Exception as error:  # whoever asks would wait for ever, but for the end of the process
            _end_now(error)

    def _tell(self, number: int, kind: Answer, content: bytes | bytearray) -> None:
        with self._writing:
            self._output.write(HEAD.pack(number, kind, len(content)))
            self._output.write(content)
            self._output.flush()


def _read(questions: IO[bytes], count: int) -> bytes:
    """Exactly `count` bytes, or none at the end."""
    read = b""
    while len(read) < count:
        if not (more := questions.read(count - len(read))):
            return b""
        read += more
    return read


def _failed(error: Exception) -> tuple[Answer, bytes]:
    content = packed_error(error)
    if is_fault(content):
        log.error("a call failed", exc_info=error)
    return Answer.ERROR, content


def _end_now(error: Exception) -> NoReturn:
    try:
        if not isinstance(error, BrokenPipeError):  # whoever asked is gone
            log.error("no answer can be sent any more", exc_info=error)
    finally:  # there may be no memory for the log
        os._exit(1)


def main(limits: Limits) -> None:
    """Answers on standard input and output, and ends with whoever asks."""
    # They are meant for the daemon, which closes standard input when it has answered its last request.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    limits.apply()
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a library prints is no answer
    child = Child(limits.threads, output)
    try:
        child.serve(os.fdopen(0, "rb", buffering=0), limits.idle_s)
    except Exception as error:  # calls that go on would keep this process
        _end_now(error)
    # Whoever asked may be gone: a thread that hangs on a disk must not keep this process.
    end = threading.Timer(LEFT_S, os._exit, (1,))
    end.daemon = True
    end.start()
    child.close()
