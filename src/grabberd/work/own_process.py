"""Questions answered by a process of their own: what computes the answers would stay in the daemon.

It takes a second of processor time to start, so it waits a while for the next question, and then ends.
"""

import json
import select
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

from grabberd.errors import StorageError
from grabberd.files.disk import storage_errors
from grabberd.memory import kill_first
from grabberd.work.content_frames import packed_error, unpacked_error

LONGEST_S = 120.0
"""Time for an answer, both attempts together; it takes a second of processor time, and a busy computer has
little."""
IDLE_S = 60.0
"""Time after an answer until the process ends by itself."""
_ATTEMPTS = 2
"""It may have ended just when it was asked."""


class _Process:
    """A process that is running, or will be when it is asked; it answers one question at a time."""

    def __init__(self, program: str) -> None:
        # -P: the current folder may hold a module of any name.
        self._command = [sys.executable, "-P", "-c", program]
        self._running: subprocess.Popen[str] | None = None
        self._one = threading.Lock()
        self._ended = False

    def ask(self, question: str) -> str:
        """The answer to a question, each a line; empty if there is none.

        Raises:
            OSError: It cannot be started.
        """
        with self._one:
            end_s = time.monotonic() + LONGEST_S
            for _ in range(_ATTEMPTS):
                if self._ended:
                    break
                if answer := self._asked(question, end_s):
                    return answer
        return ""

    def _asked(self, question: str, end_s: float) -> str:
        if self._running is not None and self._running.poll() is not None:
            self._end(self._running)
        process = self._running or self._start()
        self._running = process
        if self._ended:  # meanwhile, and `end` may not have seen this one
            self._end(process)
            return ""
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            process.stdin.write(question + "\n")
            process.stdin.flush()
            if select.select([process.stdout], [], [], max(end_s - time.monotonic(), 0.0))[0] and (
                answer := process.stdout.readline()
            ):
                return answer
        except BrokenPipeError:
            pass
        self._end(process)
        return ""

    def end(self) -> None:
        """Ends it for good, whatever it is being asked: who asks gets no answer."""
        self._ended = True
        if (running := self._running) is not None:
            running.kill()
        with self._one:
            if self._running is not None:
                self._end(self._running)

    def _start(self) -> "subprocess.Popen[str]":
        process = subprocess.Popen(  # noqa: S603 - our own
            self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, encoding="utf-8"
        )
        kill_first(process.pid)
        return process

    def _end(self, process: "subprocess.Popen[str]") -> None:
        self._running = None
        process.kill()
        process.wait()
        _close(process.stdin, process.stdout)


def _close(*pipes: IO[str] | None) -> None:
    for pipe in pipes:
        try:
            if pipe is not None:
                pipe.close()
        except BrokenPipeError:  # what it was not told any more
            pass


class OwnProcesses:
    """Processes that answer, one for each program, each from its first question on."""

    def __init__(self) -> None:
        self._processes: dict[str, _Process] = {}
        self._adding = threading.Lock()

    def ask(self, program: str, question: object, what: str) -> Any:
        """The answer of a program that calls `answer_with`.

        Args:
            program: Code of the process.
            question: What it is asked, as JSON; dates and the like go as texts.
            what: What the process does, as the message says it.

        Raises:
            StorageError: The process cannot be started, or does not answer in time.
            GrabberdError: As the answer does.
        """
        with self._adding:
            process = self._processes.setdefault(program, _Process(program))
        with storage_errors(Path(sys.executable)):
            line = process.ask(json.dumps(question, default=str, skipkeys=True))
        if not line:
            raise StorageError(
                f"the process that {what} does not answer",
                "try again in a moment; memory or processes may have run out",
            )
        answer: dict[str, Any] = json.loads(line)
        if "error" in answer:
            raise unpacked_error(answer["error"].encode())
        return answer["answer"]

    def end(self) -> None:
        """Ends those that are running, whatever they are being asked."""
        with self._adding:
            processes, self._processes = list(self._processes.values()), {}
        for process in processes:
            process.end()


def answer_with(compute: Callable[[Any], object]) -> None:
    """Answers the questions on standard input, until none comes for a while or nobody is there to ask."""
    while select.select([sys.stdin], [], [], IDLE_S)[0] and (line := sys.stdin.readline()):
        try:
            answer = {"answer": compute(json.loads(line))}
        except Exception as error:
            answer = {"error": packed_error(error).decode()}
        print(json.dumps(answer), flush=True)
