"""Asks a process of its own about files, one after the other, and kills it where a file holds it up.

Whatever a file does to its reader, be it an endless loop, all of the memory or a crash in a library, it costs
this process and the file's own answer, and nothing else.
"""

import json
import os
import resource
import selectors
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from time import monotonic
from typing import Any

from grabberd.errors import StorageError
from grabberd.files.disk import storage_errors

_STARTED_WITHIN_S = 120.0
"""Time for the process to start, which takes half a second of processor time; a busy computer has little."""
MEMORY_BYTES = 2 << 30
"""Address space of the process; it uses a tenth, and a file's largest value is 64 MiB."""
_READY = b"ready"


def ask(
    program: str, words: Sequence[str], paths: Iterable[Path], longest_s: Callable[[Path], float]
) -> Iterator[tuple[Path, Any]]:
    """Each file with its answer, a JSON value, in order; None for one that ended the process, or held it up.

    Args:
        program: Code of the process, which calls `answer_paths`.
        words: Its arguments.
        paths: The files.
        longest_s: Time for each of them.

    Raises:
        StorageError: No process can be started.
    """
    waiting = list(paths)
    while waiting:
        for line in _answers(program, words, tuple(waiting), longest_s):
            yield waiting.pop(0), json.loads(line)
        if waiting:
            yield waiting.pop(0), None


def _answers(
    program: str, words: Sequence[str], paths: Sequence[Path], longest_s: Callable[[Path], float]
) -> Iterator[bytes]:
    """Lines of a new process, one for each path, up to the first that does not come in time."""
    # -P: the current folder may be that of the captures, and hold a module of any name.
    command = [sys.executable, "-P", "-c", program, *words]
    # Threads of OpenBLAS reserve address space, which is limited here, for each processor.
    variables = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    with storage_errors(paths[0].parent):
        child = subprocess.Popen(  # noqa: S603 - our own
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=variables
        )
    lines = _Lines(child)
    try:
        if lines.next(_STARTED_WITHIN_S) != _READY:
            raise StorageError(
                "the process that reads the captures does not start",
                "look into the log for its reason; memory or processes may have run out",
            )
        for path in paths:
            lines.ask(os.fsencode(path.absolute()))
            if (line := lines.next(longest_s(path))) is None:
                return
            yield line
    finally:
        child.kill()
        child.communicate()


class _Lines:
    """Lines to and from a process."""

    def __init__(self, child: "subprocess.Popen[bytes]") -> None:
        assert child.stdin is not None
        assert child.stdout is not None
        self._to, self._from = child.stdin, child.stdout
        self._rest = b""

    def ask(self, path: bytes) -> None:
        """Sends a path; a process that has ended is noticed by the answer that does not come."""
        try:
            self._to.write(path + b"\0")
            self._to.flush()
        except BrokenPipeError:
            return

    def next(self, longest_s: float) -> bytes | None:
        """The next line; None if it does not come in time, or the process has ended."""
        until_s = monotonic() + longest_s
        with selectors.DefaultSelector() as selector:
            selector.register(self._from, selectors.EVENT_READ)
            while b"\n" not in self._rest:
                if not selector.select(until_s - monotonic()):
                    return None
                if not (more := os.read(self._from.fileno(), 65536)):
                    return None
                self._rest += more
        line, _, self._rest = self._rest.partition(b"\n")
        return line


def answer_paths(answer: Callable[[Path], Any]) -> None:
    """Answers paths from standard input, each ended by NUL, by lines of JSON; the body of the process."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    _say(_READY)
    rest = b""
    while more := os.read(0, 65536):
        *paths, rest = (rest + more).split(b"\0")
        for path in paths:
            _say(json.dumps(answer(Path(os.fsdecode(path)))).encode("ascii"))


def _say(line: bytes) -> None:
    sys.stdout.buffer.write(line + b"\n")
    sys.stdout.buffer.flush()
