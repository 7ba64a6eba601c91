"""A folder of captures made to be heavy, and many who ask for them at once: what it costs a running capture.

The daemon records at 50 Hz meanwhile. Memory is that of its process and of all its children, as the kernel
shares it out among them, less what they had while it recorded and nobody asked.
"""

import os
import shutil
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import cycle
from pathlib import Path
from typing import Any, NamedTuple

from tests.proofs.faults.daemon import RECORDED, Daemon, running
from tests.proofs.faults.failing import configuration

from .busy import busy_loops

LONG = 6
CLIENTS = 12
BUSY = 4
IDLE_S = 5.0
MOST_MB = 96.0
"""Memory over idle that a daemon may take."""
LISTS = ("captures?limit=500", "captures.csv", "captures?limit=500&facets=true", "jobs", "calibrations")
OF_A_CAPTURE = (
    *("", "/ledger?limit=500", "/runs/1", "/points?max_points=200000", "/points.csv", "/channels", "/widths"),
    *("/thumbnail.png", "/replay/points", "/replay/pictures"),
)


class Weighed(NamedTuple):
    """What became of it.

    Attributes:
        idle_mb: Memory while it records and nobody asks.
        peak_mb: The greatest while many ask.
        first_list_s: Time for the first list.
        answers: Numbers of answers by status.
        fields, lost: Of the capture, and how many of them were not received.
        tracebacks: In the daemon's journal.
    """

    idle_mb: float
    peak_mb: float
    first_list_s: float
    answers: Counter[int]
    fields: int
    lost: int
    tracebacks: int

    @property
    def over_mb(self) -> float:
        return self.peak_mb - self.idle_mb

    @property
    def row(self) -> str:
        told = ", ".join(f"{count} × {status}" for status, count in self.answers.most_common())
        memory = f"{self.idle_mb:.0f} | {self.over_mb:+.0f}"
        lost = f"{self.lost} of {self.fields} | {self.tracebacks}"
        return f"{memory} | {self.first_list_s:.1f} | {told} | {lost} |"


def table(seconds: float) -> str:
    """Quiet and beside busy loops, each for so long, as Markdown."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        hostile = Path(folder) / "hostile"
        made(hostile)
        for name, busy in (("quiet", 0), (f"{BUSY} busy loops beside it", BUSY)):
            row = weighed(Path(folder) / str(busy), hostile, seconds, busy).row
            print(name, row, file=sys.stderr)
            rows.append(f"| {name} | {row}")
    head = (
        f"{LONG} captures of 10 MB with ledgers of 400 000 entries and seven of other kinds; {CLIENTS} "
        f"clients ask for lists and for every capture for {seconds:g} s, while another one is recorded.\n\n"
        "| | idle, MB | over idle, MB | first list, s | answers | fields lost | tracebacks |\n"
        "|---|---|---|---|---|---|---|"
    )
    return "\n".join((head, *rows))


def weighed(folder: Path, hostile: Path, seconds: float, busy: int = 0) -> Weighed:
    """Measures it.

    Args:
        folder: Folder of the daemon.
        hostile: The captures that it is to have.
        seconds: How long they are asked for.
        busy: Number of busy loops beside the daemon, once it serves.
    """
    captures = folder / "state" / "captures"
    shutil.copytree(hostile, captures, copy_function=os.link)
    names = [path.stem for path in captures.iterdir()]
    with running(folder, configuration(), RECORDED) as daemon, busy_loops(busy):
        daemon.wait_until_ready()
        capture_id = daemon.start_capture()
        time.sleep(IDLE_S)
        idle_mb = memory_mb(daemon.process.pid)
        with _watched(daemon.process.pid) as peak_mb:
            begin_s = time.monotonic()
            first = daemon.ask("/api/v1/captures")
            first_list_s = time.monotonic() - begin_s
            answers = _asked(daemon, names, seconds)
            answers[first.status] += 1
        counts = _stopped(daemon, capture_id)["ledger"]["counts"]
        fields = sum(counts.values())
        tracebacks = daemon.journal.read_text().count("Traceback")
        lost = fields - counts["received"]
        return Weighed(idle_mb, max(peak_mb), first_list_s, answers, fields, lost, tracebacks)


def _stopped(daemon: Daemon, capture_id: str) -> dict[str, Any]:
    """A capture's description once it takes no more fields: points may be measured for long after that."""
    path = f"/api/v1/captures/{capture_id}"
    daemon.ask(f"{path}/stop", "POST")
    return daemon.wait_for(path, lambda document: document["state"] != "recording")


def made(captures: Path, long: int = LONG, entries: int = 400_000) -> None:
    """Makes the captures."""
    for room in ("", "support"):
        sys.path.append(str(Path(__file__).parents[2] / room))
    from hostile_captures import folder_of  # noqa: PLC0415 - of the tests, found by the lines above

    captures.mkdir(parents=True)
    folder_of(captures, long, entries)


def _asked(daemon: Daemon, names: list[str], seconds: float) -> Counter[int]:
    """Clients that ask again and again; the statuses they get, 0 for an answer that ends early."""
    of_captures = [f"captures/{name}{part}" for name in names for part in OF_A_CAPTURE]
    until_s = time.monotonic() + seconds
    answers: Counter[int] = Counter()

    def client(number: int) -> None:
        asked = [path for k, path in enumerate(of_captures) if k % CLIENTS == number]
        for path in cycle([*LISTS, *asked[: len(asked) // 2], *LISTS[:2], *asked[len(asked) // 2 :]]):
            if time.monotonic() > until_s:
                return
            try:
                answers[daemon.ask(f"/api/v1/{path}").status] += 1
            except OSError:
                answers[0] += 1
            except Exception:
                answers[0] += 1

    threads = [threading.Thread(target=client, args=(number,)) for number in range(CLIENTS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return answers


@contextmanager
def _watched(pid: int) -> Iterator[list[float]]:
    """Memory of a process with its children, twenty times a second."""
    seen, over = [memory_mb(pid)], threading.Event()

    def watch() -> None:
        while not over.wait(0.05):
            seen.append(memory_mb(pid))

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        yield seen
    finally:
        over.set()
        thread.join()


def memory_mb(pid: int) -> float:
    """Proportional share of a process and all below it."""
    return sum(map(_pss_mb, _family(pid)))


def _family(pid: int) -> Iterator[int]:
    """A process and all below it, but for those that have not begun their own program.

    Between vfork and exec a child has its parent's memory, which would count twice.
    """
    yield pid
    try:
        children = [
            int(child)
            for task in Path(f"/proc/{pid}/task").iterdir()
            for child in (task / "children").read_text().split()
        ]
    except OSError:  # it has ended
        return
    for child in children:
        if _program(child) != _program(pid):
            yield from _family(child)


def _program(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:  # it has ended
        return b""


def _pss_mb(pid: int) -> float:
    try:
        lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    except OSError:
        return 0.0
    return next((int(line.split()[1]) / 1000 for line in lines if line.startswith("Pss:")), 0.0)
