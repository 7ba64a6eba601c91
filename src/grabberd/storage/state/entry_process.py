"""Reads entries of the index in a process of its own, which is killed where a file holds it up.

Whatever a file does to its reader, be it an endless loop, all of the memory or a crash in a library, it costs
this process and the file's own entry, and nothing else.
"""

import json
import os
import resource
import selectors
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from time import monotonic
from typing import NamedTuple

from grabberd.errors import CaptureFileError, LaterVersion, StorageError
from grabberd.storage.disk import storage_errors
from grabberd.storage.patience import Patience, within
from grabberd.storage.state.index_entries import IndexEntry, damaged_entry, sealed_entry

LONGEST_S = 30.0
"""Time for one file, of which only some rows are read; a disk that has to spin up takes ten seconds."""
_STARTED_WITHIN_S = 120.0
"""Time for the process to start, which takes half a second of processor time; a busy computer has little."""
MEMORY_BYTES = 2 << 30
"""Address space of the process; it uses a tenth, and a file's largest value is 64 MiB."""
_READY = b"ready"
PROGRAM = f"from {__name__} import main; main()"


class Reading(NamedTuple):
    """Outcome of reading a file.

    Attributes:
        path: The file.
        entry: Its entry.
        is_damage: True if its content is to blame, and no later version, lock or disk.
    """

    path: Path
    entry: IndexEntry
    is_damage: bool = False


def read_entries(paths: Iterable[Path], longest_s: float = LONGEST_S) -> Iterator[Reading]:
    """Reads the entries of capture files, in order.

    Args:
        paths: The files.
        longest_s: Time for each of them.

    Raises:
        StorageError: No process can be started.
    """
    waiting = list(paths)
    while waiting:
        for line in _answers(tuple(waiting), longest_s):
            path = waiting.pop(0)
            is_damage, *entry = json.loads(line)
            yield Reading(path, IndexEntry(*entry), is_damage)
        if waiting:
            path = waiting.pop(0)
            reason = f"reading it ends the reader, or takes longer than {longest_s:g} s"
            yield Reading(path, damaged_entry(path, reason))


def _answers(paths: Sequence[Path], longest_s: float) -> Iterator[bytes]:
    """Lines of a new process, one for each path, up to the first that does not come in time."""
    # -P: the current folder may be that of the captures, and hold a module of any name.
    command = [sys.executable, "-P", "-c", PROGRAM, str(longest_s)]
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
            if (line := lines.next(longest_s)) is None:
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


def _answer(path: Path, longest_s: float) -> Reading:
    try:
        # Half the time: a statement that is too long ends by itself, with a reason.
        with within(Patience(monotonic() + longest_s / 2)):
            return Reading(path, sealed_entry(path))
    except (LaterVersion, StorageError) as error:  # the file itself may be sound
        return Reading(path, damaged_entry(path, error.message))
    except CaptureFileError as error:
        return Reading(path, damaged_entry(path, error.message), is_damage=True)
    except Exception as error:
        return Reading(path, damaged_entry(path, f"{type(error).__name__}: {error}"))


def main() -> None:
    """Answers paths from standard input, each ended by NUL, by lines of JSON."""
    longest_s = float(sys.argv[1])
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    sys.stdout.buffer.write(_READY + b"\n")
    sys.stdout.buffer.flush()
    rest = b""
    while more := os.read(0, 65536):
        *paths, rest = (rest + more).split(b"\0")
        for path in paths:
            reading = _answer(Path(os.fsdecode(path)), longest_s)
            line = json.dumps([reading.is_damage, *reading.entry])
            sys.stdout.buffer.write(line.encode("ascii") + b"\n")
            sys.stdout.buffer.flush()
