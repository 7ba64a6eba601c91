"""A process that reads contents of captures, as the daemon's event loop sees it."""

import asyncio
import itertools
import os
import sys
import time
from asyncio.subprocess import PIPE, Process
from collections.abc import Coroutine
from contextlib import suppress

from grabberd.errors import ReadingGivenUp
from grabberd.service.memory import kill_first
from grabberd.storage.content_frames import HEAD, Answer, Frame, Question, unpacked_error
from grabberd.storage.patience import given_up

GRACE_S = 5.0
"""Time to let go of what was given up, or is too late; a process that takes longer hangs, and is killed."""
READ_AHEAD_BYTES = 1 << 20


class ContentReader:
    """The process, and who waits for its answers.

    Args:
        process: Answers as `grabberd.storage.content_process` does.
    """

    def __init__(self, process: Process) -> None:
        self._process = process
        self._numbers = itertools.count(1)
        self._waiting: dict[int, asyncio.Future[Frame]] = {}
        self._open: set[int] = set()
        self._alive = True
        self._listening = asyncio.create_task(self._listen())

    @classmethod
    async def start(cls, program: str, threads: int) -> "ContentReader":
        """Starts a process; it is ready half a second of processor time later, and may be asked at once."""
        # -P: the current folder may be that of the captures, and hold a module of any name.
        command = (sys.executable, "-P", "-c", program, str(threads))
        # Threads of OpenBLAS reserve memory, which is limited there, for each processor.
        variables = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
        process = await asyncio.create_subprocess_exec(
            *command, stdin=PIPE, stdout=PIPE, env=variables, limit=READ_AHEAD_BYTES
        )
        kill_first(process.pid)
        return cls(process)

    @property
    def is_alive(self) -> bool:
        """False once it has ended."""
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
        if not self.is_alive:
            raise _ended()
        answer: asyncio.Future[Frame] = asyncio.get_running_loop().create_future()
        self._waiting[question.number] = answer
        self._tell(question)
        return self._answer(question.number, answer, until_s)

    async def _answer(self, number: int, answer: asyncio.Future[Frame], until_s: float) -> Frame:
        try:
            async with asyncio.timeout(until_s - time.monotonic() + GRACE_S):
                return self._told(await answer)
        except TimeoutError:
            self.kill()
            raise given_up("what was asked for") from None
        except asyncio.CancelledError:
            self.give_up(number)
            raise

    def give_up(self, number: int) -> None:
        """Ends a reading that nobody waits for any longer."""
        self._open.discard(number)
        if self.is_alive:
            self._tell(Frame(number, Question.GIVE_UP, b""))
            asyncio.get_running_loop().call_later(GRACE_S, self._kill_if_waiting, self._waiting.get(number))

    def kill(self) -> None:
        """Ends the process at once; what it reads is given up."""
        if self._process.returncode is None:
            with suppress(ProcessLookupError):
                self._process.kill()

    async def close(self) -> None:
        """Ends the process, which gives up what it reads, and at last kills it."""
        assert self._process.stdin is not None
        asyncio.get_running_loop().call_later(GRACE_S, self.kill)
        self._process.stdin.close()
        await self._listening

    def _tell(self, question: Frame) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(question.packed())

    def _told(self, answer: Frame) -> Frame:
        if answer.kind == Answer.BEGUN:
            self._open.add(answer.number)
        elif answer.kind != Answer.PIECE:
            self._open.discard(answer.number)
        if answer.kind == Answer.ERROR:
            raise unpacked_error(answer.content)
        return answer

    def _kill_if_waiting(self, answer: "asyncio.Future[Frame] | None") -> None:
        if answer is not None and answer in self._waiting.values():
            self.kill()

    async def _listen(self) -> None:
        """Hands answers to who waits for them, until the process ends."""
        assert self._process.stdout is not None
        with suppress(asyncio.IncompleteReadError, ConnectionError):
            while True:
                number, kind, length = HEAD.unpack(await self._process.stdout.readexactly(HEAD.size))
                answer = Frame(number, kind, await self._process.stdout.readexactly(length))
                waiting = self._waiting.pop(number, None)
                if waiting is not None and not waiting.done():
                    waiting.set_result(answer)
        self._alive = False
        for waiting in self._waiting.values():
            if not waiting.done():
                waiting.set_exception(_ended())
        self._waiting.clear()
        self._open.clear()
        await self._process.wait()


def _ended() -> ReadingGivenUp:
    return ReadingGivenUp(
        "the process that reads captures ended while it read what was asked for",
        "ask again; if it ends again, check the capture: grabberd storage verify",
    )
