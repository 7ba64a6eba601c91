"""A process that reads contents of captures, as the daemon's event loop sees it."""

import asyncio
import itertools
import os
import subprocess
import sys
import time
from collections.abc import Coroutine

from grabberd.errors import ReadingGivenUp
from grabberd.files.patience import given_up
from grabberd.memory import kill_first
from grabberd.work.content_frames import HEAD, Answer, Frame, Question, unpacked_error

GRACE_S = 5.0
"""Time to let go of what was given up, or is too late; a process that takes longer hangs, and is killed."""
KILLED_S = 3.0
"""Time for a killed process to end; one that waits for a disk that is gone is not waited for any longer."""
READ_AHEAD_BYTES = 1 << 20
"""Bytes of answers that are kept for who waits for them, before the process has to wait to write more."""
_REAPED_EVERY_S = 0.02


class ContentReader:
    """The process, and who waits for its answers; made by `start`.

    Args:
        process: Answers as `grabberd.archive.content_process` does.
    """

    def __init__(self, process: "subprocess.Popen[bytes]") -> None:
        self._process = process
        self._numbers = itertools.count(1)
        self._waiting: dict[int, asyncio.Future[Frame]] = {}
        self._open: set[int] = set()
        self._alive = True
        self._answers = asyncio.StreamReader(READ_AHEAD_BYTES)
        self._questions: asyncio.WriteTransport | None = None
        self._pipe: asyncio.ReadTransport | None = None
        self._listening: asyncio.Task[None] | None = None

    @classmethod
    async def start(cls, program: str, threads: int) -> "ContentReader":
        """Starts a process; it is ready half a second of processor time later, and may be asked at once.

        Raises:
            OSError: There is no room for a further process, or no file descriptor.
        """
        # -P: the current folder may be that of the captures, and hold a module of any name.
        command = (sys.executable, "-P", "-c", program, str(threads))
        # Each thread of OpenBLAS reserves memory, which is limited there.
        variables = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
        # Not by asyncio, which, before Python 3.12, starts a thread for each process and, where it cannot,
        # leaves the process to nobody. A session of its own: Ctrl-C is meant for the daemon.
        process = subprocess.Popen(  # noqa: S603 - it forks without copying memory; the program is ours
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=variables, start_new_session=True
        )
        reader = cls(process)
        try:
            await reader._connect()
        except BaseException:
            process.kill()
            process.communicate()
            raise
        kill_first(process.pid)
        return reader

    @property
    def is_alive(self) -> bool:
        """False once it has ended, or was killed."""
        return self._alive

    @property
    def count(self) -> int:
        """Number of answers that are waited for, or were until they were given up."""
        return len(self._waiting)

    @property
    def is_idle(self) -> bool:
        """True if nothing is read, and no content is half sent."""
        return not self._waiting and not self._open

    def new_number(self) -> int:
        """Number of a further reading."""
        return next(self._numbers)

    def ask(self, question: Frame, until_s: float) -> Coroutine[None, None, Frame]:
        """Asks at once; returns what waits for the answer, and gives the reading up if it is cancelled.

        Args:
            question: What is asked.
            until_s: End of the patience that the question carries.

        Raises:
            ReadingGivenUp: There is none in time, or the process has ended.
            GrabberdError: As the reading does.
        """
        if not self._alive:
            raise _ended()
        answer: asyncio.Future[Frame] = asyncio.get_running_loop().create_future()
        self._waiting[question.number] = answer
        self._tell(question)
        return self._answer(question.number, answer, until_s)

    def give_up(self, number: int) -> None:
        """Ends a reading that nobody waits for any longer; does nothing if it has ended."""
        answer = self._waiting.get(number)
        if self._alive and (answer is not None or number in self._open):
            self._open.discard(number)
            self._tell(Frame(number, Question.GIVE_UP, b""))
            if answer is not None:
                asyncio.get_running_loop().call_later(GRACE_S, self._kill_if_waiting, answer)

    def kill(self) -> None:
        """Ends the process at once; what it reads is given up."""
        self._alive = False
        if self._process.poll() is None:
            self._process.kill()

    async def close(self, grace_s: float = GRACE_S) -> None:
        """Ends the process, which gives up what it reads, and kills it if it has not ended in time."""
        assert self._questions is not None
        assert self._listening is not None
        self._questions.close()
        await asyncio.wait((self._listening,), timeout=grace_s)
        self.kill()
        await asyncio.wait((self._listening,), timeout=KILLED_S)

    async def _connect(self) -> None:
        loop = asyncio.get_running_loop()
        protocol = asyncio.StreamReaderProtocol(self._answers)
        self._pipe, _ = await loop.connect_read_pipe(lambda: protocol, self._process.stdout)
        self._questions, _ = await loop.connect_write_pipe(asyncio.BaseProtocol, self._process.stdin)
        self._listening = asyncio.create_task(self._listen())

    def _tell(self, question: Frame) -> None:
        assert self._questions is not None
        self._questions.write(question.head())
        self._questions.write(question.content)

    async def _answer(self, number: int, answer: asyncio.Future[Frame], until_s: float) -> Frame:
        try:
            async with asyncio.timeout(until_s - time.monotonic() + GRACE_S):
                found = await answer
        except TimeoutError:
            self.kill()
            raise given_up("what was asked for") from None
        except asyncio.CancelledError:
            self.give_up(number)
            raise
        if found.kind == Answer.ERROR:
            raise unpacked_error(found.content)
        return found

    def _kill_if_waiting(self, answer: asyncio.Future[Frame]) -> None:
        if answer in self._waiting.values():
            self.kill()

    async def _listen(self) -> None:
        """Hands answers to who waits for them, until the process ends; then it is reaped."""
        try:
            while True:
                number, kind, length = HEAD.unpack(await self._answers.readexactly(HEAD.size))
                self._hand_on(Frame(number, kind, await self._answers.readexactly(length)))
        except (asyncio.IncompleteReadError, ConnectionError):
            pass
        finally:
            self.kill()  # it may have closed its output alone
            self._leave()
        while self._process.poll() is None:
            await asyncio.sleep(_REAPED_EVERY_S)

    def _hand_on(self, answer: Frame) -> None:
        waiting = self._waiting.pop(answer.number, None)
        if waiting is None or waiting.done():  # it was given up
            return
        if answer.kind == Answer.BEGUN:
            self._open.add(answer.number)
        elif answer.kind != Answer.PIECE:
            self._open.discard(answer.number)
        waiting.set_result(answer)

    def _leave(self) -> None:
        """Tells who waits that there will be no answer."""
        for waiting in self._waiting.values():
            if not waiting.done():
                waiting.set_exception(_ended())
        self._waiting.clear()
        self._open.clear()
        for pipe in (self._questions, self._pipe):
            if pipe is not None:
                pipe.close()


def _ended() -> ReadingGivenUp:
    return ReadingGivenUp(
        "the process that reads captures ended while it read what was asked for",
        "ask again; if it ends each time, 'grabberd storage verify' tells whether the capture is damaged",
    )
