"""Attacks on the daemon: who asks beside them is answered, and no field is lost, quiet or busy."""

import http.client
import multiprocessing
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import closing, contextmanager
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tests.proofs.faults.clients import resident_kb
from tests.proofs.faults.daemon import RECORDED, Daemon, running
from tests.proofs.faults.failing import configuration

from .armour_attacks import ATTACKS, TIMEOUT_S, Answers, Target, address
from .busy import busy_loops

BUSY = 4
FEW = 64
"""File descriptors of the daemon that has few."""
ASKED_EVERY_S = 0.05
FIELDS = 3000
"""Fields of the capture that takes long to read."""
WARM_UP_S = 3.0
BEGUN = "begun"
FEW_DESCRIPTORS = ("bash", "-c", f'ulimit -n {FEW}; exec "$@"', "bash", *RECORDED)


class Outcome(NamedTuple):
    """What became of the daemon in an attack.

    Attributes:
        answers: What the attackers were told.
        waited_s: Time for each answer to somebody who asks for health and state beside them.
        failed: Those who were not answered by 200.
        lost: Fields of a capture that were not received.
        grown_mb: What its memory has grown by.
    """

    answers: Answers
    waited_s: list[float]
    failed: int
    lost: int
    grown_mb: float

    def row(self, attack: str) -> str:
        """As a row of the table."""
        told = ", ".join(f"{count} × {what}" for what, count in self.answers.most_common(4)) or "–"
        p50, p99 = np.percentile([1e3 * one for one in self.waited_s], (50, 99)) if self.waited_s else (0, 0)
        asked = f"{p50:.0f} / {p99:.0f}"
        return f"| {attack} | {told} | {asked} | {self.failed} | {self.lost} | {self.grown_mb:+.0f} |"


def table(seconds: float) -> str:
    """All attacks, each for so long, as Markdown."""
    parts = []
    with tempfile.TemporaryDirectory() as folder:
        for name, busy in (("quiet", 0), (f"{BUSY} busy loops beside it", BUSY)):
            with busy_loops(busy):
                parts.append(_attacked(Path(folder) / str(busy), name, seconds, RECORDED, list(ATTACKS)))
        few = [
            "nobody",
            "200 clients send their heads a byte at a time",
            "1000 clients hold a connection each",
        ]
        parts.append(
            _attacked(Path(folder) / "few", f"{FEW} file descriptors", seconds, FEW_DESCRIPTORS, few)
        )
    return "\n\n".join(parts)


def _attacked(folder: Path, name: str, seconds: float, command: tuple[str, ...], attacks: list[str]) -> str:
    capture_id = _long_capture(folder / "state" / "captures")
    with running(folder, configuration(), command) as daemon:
        daemon.wait_until_ready()
        target = Target(daemon.port, capture_id)
        time.sleep(WARM_UP_S)
        rows = [_outcome(daemon, target, attack, seconds).row(attack) for attack in attacks]
    head = (
        f"**{name[0].upper()}{name[1:]}**, {seconds:g} s each; load {os.getloadavg()[0]:.1f} on "
        f"{os.cpu_count()} processors at the end.\n\n"
        "| attack | what the attackers are told | health and state, p50 / p99 ms | of these not answered "
        "| fields lost | memory, MB |\n|---|---|---|---|---|---|"
    )
    return "\n".join((head, *rows))


def _long_capture(captures: Path) -> str:
    """A sealed capture with many points, in the folder of a daemon that has not started yet."""
    sys.path.append(str(Path(__file__).parents[2]))
    from archive.captures import META, slots, write  # noqa: PLC0415 - of the tests, found by the line above

    captures.mkdir(parents=True)
    write(captures, slots(FIELDS), measured=range(FIELDS), name=META.id)
    return META.id


def _outcome(daemon: Daemon, target: Target, attack: str, seconds: float) -> Outcome:
    before_kb = resident_kb(daemon.process.pid)
    capture_id = daemon.start_capture()
    with _attacking(attack, target) as answers:
        waited_s, failed = _asked(daemon.port, seconds)
        grown_mb = (resident_kb(daemon.process.pid) - before_kb) / 1024
    counts = daemon.stop_capture(capture_id)["ledger"]["counts"]
    return Outcome(answers, waited_s, failed, sum(counts.values()) - counts["received"], grown_mb)


@contextmanager
def _attacking(attack: str, target: Target) -> Iterator[Answers]:
    """Attackers in a process of their own; their answers are there after the block."""
    context = multiprocessing.get_context("spawn")
    over, (told, tell), answers = context.Event(), context.Pipe(duplex=False), Counter[str]()
    process = context.Process(target=_attack, args=(attack, target, over, tell))
    process.start()
    assert told.recv() == BEGUN
    try:
        yield answers
    finally:
        over.set()
        answers.update(told.recv())
        process.join()


def _attack(attack: str, target: Target, over: Event, tell: Connection) -> None:
    answers: Answers = Counter()
    tell.send(BEGUN)
    ATTACKS[attack](target, over, answers)
    tell.send(dict(answers))


def _asked(port: int, seconds: float) -> tuple[list[float], int]:
    """Asks for health and state twenty times a second; how long each answer took, and how many failed."""
    waited_s, failed = [], 0
    until_s = time.monotonic() + seconds
    while (begin_s := time.monotonic()) < until_s:
        path = ("/healthz", "/api/v1/state")[len(waited_s) % 2]
        try:
            failed += _status(port, path) != 200
        except OSError:
            failed += 1
        waited_s.append(time.monotonic() - begin_s)
        time.sleep(max(0.0, begin_s + ASKED_EVERY_S - time.monotonic()))
    return waited_s, failed


def _status(port: int, path: str) -> int:
    source = (address(1999), 0)
    with closing(http.client.HTTPConnection("127.0.0.1", port, TIMEOUT_S, source)) as connection:
        connection.request("GET", path)
        response = connection.getresponse()
        response.read()
        return response.status
