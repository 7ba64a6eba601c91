"""A process that runs functions for this one, seen from outside; `child` is the other side.

Whatever a function does, be it an endless loop, all of the memory or a crash in a library, it costs that
process and its own answer, and nothing else. Who waits may block, as here, or be an event loop
(`grabberd.server.api.contents`).
"""

import itertools
import json
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from grabberd import runtime
from grabberd.errors import StorageError
from grabberd.files.disk import storage_errors
from grabberd.files.reading import check_patience
from grabberd.memory import kill_first
from grabberd.work.child import Limits
from grabberd.work.frames import HEAD, NUMBER, Answer, Call, Frame, Question, unpacked_error

LONGEST_S = 120.0
"""Time for an answer of `Processes`, both attempts together, and for a process to start, which takes half a
second of processor time; a busy computer has little."""
IDLE_S = 60.0
"""Time after an answer until a process of `Processes` ends by itself."""
KILLED_S = 10.0
"""A killed process that waits for a slow disk ends only when the disk has answered."""
LOOK_EVERY_S = 0.2
"""Interval at which to look whether somebody still waits."""
_ATTEMPTS = 2
"""It may have ended just when it was asked."""
HOSTILE = Limits(address_bytes=2 << 30)
"""For who reads files of unknown content; it uses a tenth, and a file's largest value is 64 MiB."""
_FOR_LONG_S = 1e6
"""Patience with a piece of a stream: it is its client who gives up, not the process."""


class NoAnswer(StorageError):
    """The process has ended, or took too long."""

    def __init__(self, what: str = "was asked") -> None:
        super().__init__(
            f"the process that {what} does not answer",
            "try again in a moment; memory or processes may have run out",
        )


def start(limits: Limits, *, end_with_parent: bool = False) -> runtime.ChildProcess:
    """Starts a process; it is ready half a second of processor time later, and may be asked at once.

    Args:
        limits: What it may take.
        end_with_parent: Has the kernel kill it with this thread, amid whatever it computes.

    Raises:
        OSError: There is no room for a further process, or no file descriptor.
    """
    if end_with_parent:
        limits = replace(limits, parent=os.getpid())
    # Niced before it imports anything, which takes half a second of processor time.
    program = (
        f"import os; os.nice({limits.niceness}); from grabberd.work.child import Limits, main; "
        f"main({limits!r})"
    )
    process = runtime.process(  # it forks without copying memory
        # -P: the current folder may be that of the captures, and hold a module of any name.
        (sys.executable, "-P", "-c", program),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        # Each thread of OpenBLAS reserves memory, which is limited there.
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        # Ctrl-C is meant for this process.
        start_new_session=True,
    )
    kill_first(process.pid)
    return process


class Process:
    """A process that is asked by one thread at a time, and may be killed by any.

    Args:
        limits, end_with_parent: See `start`.

    Raises:
        OSError: See `start`.
    """

    def __init__(self, limits: Limits, *, end_with_parent: bool = False) -> None:
        self._process = start(limits, end_with_parent=end_with_parent)
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._questions, self._answers = self._process.stdin, self._process.stdout
        self._numbers = itertools.count(1)
        self._received = bytearray()
        self._killed = False

    @property
    def alive(self) -> bool:
        """True until it has ended, or is about to."""
        return not self._killed and self._process.poll() is None

    @property
    def pid(self) -> int:
        """Id of the process."""
        return self._process.pid

    @property
    def exit_code(self) -> int | None:
        """Exit code; a signal is negative; None while it runs."""
        return self._process.poll()

    def ready(self, longest_s: float) -> None:
        """Waits until it has started.

        Raises:
            NoAnswer: It does not, in that time.
        """
        self._receive(0, longest_s)

    def call(
        self,
        function: str,
        *arguments: Any,
        longest_s: float | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Any:
        """The answer of a function: bytes, or any JSON value.

        Args:
            function: See `Call`.
            *arguments: What it is called with; they are pickled.
            longest_s: Time for it; None: it takes as long as it takes.
            progress: Called with each share that the function reports, by its own keyword `progress`.

        Raises:
            NoAnswer: The process has ended, or takes too long; nothing else can be asked of it.
            GrabberdError: As the function does.
            RuntimeError: The function failed otherwise; its traceback is in the log.
        """
        number = self._ask(Call(function, arguments, reports=progress is not None))
        end_s = None if longest_s is None else runtime.monotonic() + longest_s
        while True:
            answer = self._receive(number, None if end_s is None else end_s - runtime.monotonic())
            if answer.kind == Answer.PROGRESS:
                assert progress is not None
                progress(*NUMBER.unpack(answer.content))
            else:
                return json.loads(answer.content) if answer.kind == Answer.VALUE else answer.content

    def stream(self, function: str, *arguments: Any) -> Generator[bytes, None, None]:
        """The pieces that a function makes, as they are asked for.

        Raises:
            NoAnswer, GrabberdError, RuntimeError: See `call`.
        """
        number = self._ask(Call(function, arguments))
        answer = self._receive(number)
        while answer.kind != Answer.END:
            if answer.content:
                yield answer.content
            self._send(Frame(number, Question.NEXT, NUMBER.pack(runtime.monotonic() + _FOR_LONG_S)))
            answer = self._receive(number)

    def kill(self) -> None:
        """Ends it at once, from any thread."""
        self._killed = True
        self._process.kill()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(KILLED_S)

    def close(self) -> None:
        """Ends it; called by the thread that asks."""
        self.kill()
        with suppress(BrokenPipeError):  # what it has not read any more
            self._questions.close()
        self._answers.close()

    def _ask(self, call: Call) -> int:
        number = next(self._numbers)
        self._send(Frame(number, Question.CALL, pickle.dumps(call)))
        return number

    def _send(self, question: Frame) -> None:
        """A process that has ended is noticed by the answer that does not come."""
        with suppress(BrokenPipeError):
            self._questions.write(question.head() + question.content)
            self._questions.flush()

    def _receive(self, number: int, longest_s: float | None = None) -> Frame:
        end_s = None if longest_s is None else runtime.monotonic() + longest_s
        while True:
            if (frame := self._received_frame()) is None:
                self._read(end_s)
            elif frame.number == number:
                if frame.kind == Answer.ERROR:
                    raise unpacked_error(frame.content)
                return frame

    def _read(self, end_s: float | None) -> None:
        while (more := runtime.read(self._answers, LOOK_EVERY_S)) is None:
            check_patience("what was asked for")
            if end_s is not None and runtime.monotonic() >= end_s:
                raise NoAnswer
        if not more:
            raise NoAnswer
        self._received += more

    def _received_frame(self) -> Frame | None:
        if len(self._received) < HEAD.size:
            return None
        number, kind, length = HEAD.unpack_from(self._received)
        end = HEAD.size + length
        if len(self._received) < end:
            return None
        frame = Frame(number, kind, bytes(self._received[HEAD.size : end]))
        del self._received[:end]
        return frame


def ask_each(
    limits: Limits, function: str, paths: Iterable[Path], longest_s: Callable[[Path], float], *arguments: Any
) -> Iterator[tuple[Path, Any]]:
    """Each file with a function's answer, in order; None for one that ended the process, or held it up.

    Args:
        limits: See `start`.
        function: Called with the path and the arguments, by one process after the other.
        paths: The files.
        longest_s: Time for each of them.
        arguments: Further arguments.

    Raises:
        StorageError: No process can be started.
    """
    waiting = list(paths)
    while waiting:
        with storage_errors(waiting[0].parent):
            process = Process(limits)
        with closing(process):
            try:
                process.ready(LONGEST_S)
            except NoAnswer as error:
                raise StorageError(
                    "the process that reads the captures does not start",
                    "look into the log for its reason; memory or processes may have run out",
                ) from error
            for path in tuple(waiting):
                try:
                    seconds = longest_s(path)
                    yield path, process.call(function, path.absolute(), *arguments, longest_s=seconds)
                except NoAnswer:
                    yield path, None
                    break
                finally:
                    waiting.remove(path)


class _Kept:
    """A process that is running, or will be when it is asked; it answers one question at a time."""

    def __init__(self, idle_s: float) -> None:
        self._limits = Limits(idle_s=idle_s)
        self.process: Process | None = None
        self._one = runtime.lock()
        self._ended = False

    def ask(self, function: str, question: object) -> Any:
        """The answer to a question.

        Raises:
            NoAnswer, GrabberdError: See `Process.call`.
            OSError: It cannot be started.
        """
        with self._one:
            end_s = runtime.monotonic() + LONGEST_S
            for _ in range(_ATTEMPTS):
                try:
                    process = self._running()
                    return process.call(function, question, longest_s=max(end_s - runtime.monotonic(), 0.0))
                except NoAnswer:
                    self._close()
        raise NoAnswer

    def _running(self) -> Process:
        if self.process is not None and not self.process.alive:
            self._close()
        if self.process is None:
            self.process = Process(self._limits)
        if self._ended:  # `end` may not have seen this one
            raise NoAnswer
        return self.process

    def _close(self) -> None:
        if self.process is not None:
            self.process.close()
            self.process = None

    def end(self) -> None:
        """Ends it for good, whatever it is being asked: who asks gets no answer."""
        self._ended = True
        if (process := self.process) is not None:
            process.kill()
        with self._one:
            self._close()


class Processes:
    """Processes that answer, one for each function, each from its first question on.

    What computes the answers would stay in the daemon. A process takes a second of processor time to start,
    so it waits a while for the next question, and then ends.

    Args:
        idle_s: That while.
    """

    def __init__(self, idle_s: float = IDLE_S) -> None:
        self._idle_s = idle_s
        self._kept: dict[str, _Kept] = {}
        self._adding = runtime.lock()

    def ask(self, function: str, question: object, what: str) -> Any:
        """The answer of a function, a JSON value.

        Args:
            function: `MODULE:NAME`.
            question: What it is called with, as JSON has it: dates and the like go as texts.
            what: What the process does, as the message says it.

        Raises:
            NoAnswer: The process cannot be started, or does not answer in time.
            GrabberdError: As the function does.
        """
        with self._adding:
            kept = self._kept.setdefault(function, _Kept(self._idle_s))
        plain = json.loads(json.dumps(question, default=str, skipkeys=True))
        try:
            with storage_errors(Path(sys.executable)):
                return kept.ask(function, plain)
        except NoAnswer as error:
            raise NoAnswer(what) from error

    def end(self) -> None:
        """Ends those that are running, whatever they are being asked."""
        with self._adding:
            kept, self._kept = list(self._kept.values()), {}
        for one in kept:
            one.end()
