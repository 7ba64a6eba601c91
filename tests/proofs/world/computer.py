"""The computer of a world: its scheduler, and a disk, databases and processes that take simulated time.

A commit – of a database, of a name, an fsync – takes as long as the weather has it, and may be the last: when
the disk has crashed, the thread that committed runs no more, and the world's first thread is woken to end all
others. SQLite never waits by itself for another connection, since all are of one process: who finds a
database locked tries again a little later, as long as SQLite would.
"""

import io
import json
import pickle
import pkgutil
import sqlite3
import weakref
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from typing import Any

from tests.proofs.world.disk import Disk
from tests.proofs.world.scheduler import START_UTC, Scheduler
from tests.proofs.world.waiting import Task

from grabberd.work.frames import HEAD, NUMBER, Answer, Call, Question, packed_error

AGAIN_S = 0.004
"""Until a locked database is tried again."""
STARTING_S = 0.5
"""Until a child process answers."""
_EPOCH_NS = round(START_UTC.timestamp()) * 10**9


class Computer(Scheduler):
    """See above.

    Args:
        seed: of all decisions.
        folder: of the disk.

    Attributes:
        disk: Its disk.
        commit_s: Gives the time that the next commit takes.
        controller: The thread that ends a crashed daemon's.
        jobs_end: Called by a child process with each job that it has done.
        failures: Threads of the daemon that an error has ended.
        processes: Those that run.
    """

    def __init__(self, seed: int, folder: Path, switch_every: float = 40.0) -> None:
        super().__init__(seed, switch_every)
        self.disk = Disk(folder)
        self.commit_s: Callable[[], float] = lambda: 0.002
        self.controller: Task | None = None
        self.failures: list[tuple[str, BaseException]] = []
        self.processes: weakref.WeakSet[_Process] = weakref.WeakSet()
        self._connections: weakref.WeakSet[sqlite3.Connection] = weakref.WeakSet()

    def failed(self, task: Task, error: BaseException) -> None:
        if not task.is_daemons:
            raise error
        self.failures.append((task.name, error))

    def time_jumped(self) -> None:
        self.disk.at(_EPOCH_NS + self.now_ns + round(self.utc_step.total_seconds() * 1e9))

    # Commits

    def committed(self) -> None:
        """Takes the time of a commit, or ends here."""
        if self.current.is_dying:
            return
        if self.disk.has_crashed and self.current.is_daemons:
            self.halt()
        self.sleep(self.commit_s())

    def halt(self) -> None:
        """No thread of the daemon runs on; never returns to one."""
        self.halts = True
        if self.controller is not None:
            self.wake(self.controller)
            self.controller = None
        if self.current.is_daemons:
            self.block()

    def fsync(self, descriptor: int) -> None:
        super().fsync(descriptor)
        self.committed()

    def rename(self, old: Any, new: Any) -> None:
        super().rename(old, new)
        self.committed()

    def replace(self, old: Any, new: Any) -> None:
        super().replace(old, new)
        self.committed()

    def connect(self, database: Any, *, timeout: float = 5.0, **options: Any) -> Any:
        factory = _simulated(options.pop("factory", sqlite3.Connection))
        connection = sqlite3.connect(database, timeout=0.0, factory=factory, **options)
        connection.simulate(self, timeout, counts=":memory:" not in str(database))
        self._connections.add(connection)
        return connection

    def close_all(self) -> None:
        """Closes what a killed daemon had open."""
        for one in list(self._connections):
            with suppress(sqlite3.Error):
                one.close()
        self._connections.clear()

    # Processes

    def process(self, command: Sequence[str], **_: Any) -> Any:
        one = _Process(self)
        self.processes.add(one)
        return one

    def read(self, pipe: Any, timeout_s: float) -> bytes | None:
        return pipe.take(timeout_s)


class _Patient:
    """A connection whose commits take simulated time, and which waits in simulated time for others."""

    _computer: Computer
    _patience_s = 0.0
    _counts = False

    def simulate(self, computer: Computer, patience_s: float, *, counts: bool) -> None:
        self._computer, self._patience_s, self._counts = computer, patience_s, counts

    def execute(self, statement: str, *values: Any) -> Any:
        if statement.startswith("PRAGMA busy_timeout"):
            self._patience_s = int(statement.split("=")[1]) / 1000
            return super().execute("SELECT 1")
        found = self._patiently(partial(super().execute, statement, *values))
        if self._counts and statement.startswith(("COMMIT", "PRAGMA journal_mode")):
            self._computer.committed()
        return found

    def executemany(self, statement: str, *values: Any) -> Any:
        return self._patiently(partial(super().executemany, statement, *values))

    def commit(self) -> None:
        was = self.in_transaction
        self._patiently(super().commit)
        if was and self._counts:
            self._computer.committed()

    def __exit__(self, kind: Any, *rest: Any) -> Any:
        if kind is None:
            self.commit()
        return super().__exit__(kind, *rest)

    def _patiently(self, what: Callable[[], Any]) -> Any:
        computer = getattr(self, "_computer", None)
        if computer is None:
            return what()
        until_ns = computer.now_ns + round(self._patience_s * 1e9)
        while True:
            try:
                return what()
            except sqlite3.OperationalError as error:
                if error.sqlite_errorcode & 0xFF != sqlite3.SQLITE_BUSY or computer.now_ns >= until_ns:
                    raise
                computer.sleep(AGAIN_S)


@cache
def _simulated(factory: type[sqlite3.Connection]) -> type[Any]:
    """The same class of connections, in simulated time."""
    return type(f"Simulated{factory.__name__}", (_Patient, factory), {})


class _Pipe(io.RawIOBase):
    """What a process has written and the daemon has not read."""

    def __init__(self, computer: Computer) -> None:
        self._computer = computer
        self._bytes = bytearray()
        self._ended = False
        self._changed = computer.condition()

    def put(self, content: bytes) -> None:
        with self._changed:
            self._bytes += content
            self._changed.notify_all()

    def end(self) -> None:
        with self._changed:
            self._ended = True
            self._changed.notify_all()

    def take(self, timeout_s: float | None) -> bytes | None:
        with self._changed:
            if not self._changed.wait_for(lambda: self._bytes or self._ended, timeout_s):
                return None
            taken = bytes(self._bytes)
            self._bytes.clear()
            return taken

    def write(self, content: Any) -> int:
        if self._ended:
            raise BrokenPipeError
        self.put(bytes(content))
        return len(content)


class _Process:
    """A child: it speaks the protocol of `work.child`, and runs the same functions, in a simulated thread."""

    pids = iter(range(1 << 22, 1 << 30))  # beyond those that the kernel gives

    def __init__(self, computer: Computer) -> None:
        self.pid = next(self.pids)
        self.stdin, self.stdout = _Pipe(computer), _Pipe(computer)
        self.returncode: int | None = None
        self._computer = computer
        self._task = computer.spawn(self._run, f"process-{self.pid}")

    def poll(self) -> int | None:
        return self.returncode

    def kill(self) -> None:
        if self.returncode is None:
            self.returncode = -9
            self.stdin.end()
            self.stdout.end()
            if self._task is not self._computer.current:
                self._computer.kill([self._task])

    def wait(self, timeout: float | None = None) -> int | None:
        return self.returncode

    def _run(self) -> None:
        self._computer.sleep(STARTING_S)
        self._tell(0, Answer.READY, b"")
        received = bytearray()
        while more := self.stdin.take(None):
            received += more
            while len(received) >= HEAD.size:
                number, kind, length = HEAD.unpack_from(received)
                if len(received) < HEAD.size + length:
                    break
                content = bytes(received[HEAD.size : HEAD.size + length])
                del received[: HEAD.size + length]
                assert kind == Question.CALL, "nothing that is simulated answers in pieces"
                self._answer(number, pickle.loads(content))
        self.returncode = 0 if self.returncode is None else self.returncode
        self.stdout.end()

    def _answer(self, number: int, call: Call) -> None:
        def report(share: float) -> None:
            self._tell(number, Answer.PROGRESS, NUMBER.pack(share))

        try:
            reports = {"progress": report} if call.reports else {}
            found = pkgutil.resolve_name(call.function)(*call.arguments, **reports)
        except Exception as error:
            self._tell(number, Answer.ERROR, packed_error(error))
        else:
            whole = isinstance(found, bytes | bytearray)
            self._tell(
                number,
                Answer.WHOLE if whole else Answer.VALUE,
                found if whole else json.dumps(found).encode(),
            )

    def _tell(self, number: int, kind: Answer, content: bytes) -> None:
        self.stdout.put(HEAD.pack(number, kind, len(content)) + content)
