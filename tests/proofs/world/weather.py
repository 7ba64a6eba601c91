"""What goes wrong in a world, alone and in pairs, by the seed.

Taken from what the kernel's documentation says of V4L2, USB, clocks, signals and file systems, and from a
list of the faults that grabbers show; not from the code of the daemon.
"""

import errno
import random
from collections.abc import Callable
from dataclasses import dataclass
from datetime import timedelta
from itertools import combinations_with_replacement
from typing import TYPE_CHECKING

from tests.proofs.world.camera import Kind, Trouble
from tests.proofs.world.disk import Refusal

if TYPE_CHECKING:
    from tests.proofs.world.world import World

NS = 10**9


NEVER_NS = 1 << 62


@dataclass
class Spell:
    """A fault that was, or is, for the auditor.

    Attributes:
        fault: Its name in `FAULTS`.
        begin_ns, end_ns: When.
    """

    fault: str
    begin_ns: int
    end_ns: int = NEVER_NS


Fault = Callable[["World", random.Random], None]
"""Does it, and returns when it is over."""


def _camera(kind: str, *lengths_s: float, shares: tuple[float, ...] = (1.0,)) -> Fault:
    def happen(world: "World", draw: random.Random) -> None:
        now_ns, length_ns = world.computer.now_ns, round(draw.choice(lengths_s) * NS)
        camera = draw.choice(list(world.cameras.values()))
        camera.troubles.append(Trouble(kind, now_ns, now_ns + length_ns, draw.choice(shares)))
        world.computer.sleep(length_ns / NS)

    return happen


def _frozen(world: "World", draw: random.Random) -> None:
    world.computer.stop_computer(draw.choice((0.06, 0.3, 0.9, 3.0, 12.0)))


def _busy(world: "World", draw: random.Random) -> None:
    mean_s = draw.choice((0.005, 0.02, 0.08))

    def late_ns(name: str) -> int:
        # The kernel lets the capture thread come first, as it was asked to.
        share = 0.1 if name.startswith("capture-") else 1.0
        return round(draw.expovariate(1.0 / (mean_s * share)) * NS)

    world.computer.lateness_ns = late_ns
    world.computer.sleep(draw.choice((1.0, 3.0, 10.0)))
    world.computer.lateness_ns = None


BEHIND = ("recorder-", "writer-", "logger-", "jobs")
"""Threads of the daemon that come after those that take fields and answer clients."""


def _starved(world: "World", draw: random.Random) -> None:
    mean_s = draw.choice((0.2, 0.5, 1.5))
    world.computer.lateness_ns = lambda name: (
        round(draw.expovariate(1.0 / mean_s) * NS) if name.startswith(BEHIND) else 0
    )
    world.computer.sleep(draw.choice((3.0, 10.0)))
    world.computer.lateness_ns = None


def _clock_set(world: "World", draw: random.Random) -> None:
    world.computer.utc_step += timedelta(seconds=draw.choice((-86400.0, -3600.0, -1.0, 0.5, 3600.0, 86400.0)))


def _disk_slow(world: "World", draw: random.Random) -> None:
    mean_s = draw.choice((0.05, 0.3, 1.0))
    world.computer.commit_s = lambda: draw.expovariate(1.0 / mean_s)
    world.computer.sleep(draw.choice((3.0, 10.0, 30.0)))
    world.computer.commit_s = world.usual_commit_s


def _disk_hangs(world: "World", draw: random.Random) -> None:
    until_ns = world.computer.now_ns + round(draw.choice((1.0, 5.0, 9.0, 25.0)) * NS)
    world.computer.commit_s = lambda: max((until_ns - world.computer.now_ns) / NS, 0.002)
    world.computer.sleep((until_ns - world.computer.now_ns) / NS)
    world.computer.commit_s = world.usual_commit_s


def _refusing(what: int, error: int, *lengths_s: float) -> Fault:
    def happen(world: "World", draw: random.Random) -> None:
        world.computer.disk.refuse(what, error, draw.randint(0, 5))
        world.computer.sleep(draw.choice(lengths_s))
        world.computer.disk.refuse(Refusal.NOTHING)

    return happen


def _nearly_full(world: "World", draw: random.Random) -> None:
    before = world.daemon.free_bytes
    world.daemon.free_bytes = 100_000_000
    world.computer.sleep(draw.choice((2.0, 10.0, 30.0)))
    world.daemon.free_bytes = before


def _crash(*, power_cut: bool, at_commit: bool) -> Fault:
    def happen(world: "World", draw: random.Random) -> None:
        with world.turn:
            world.crash(power_cut=power_cut, after_commits=draw.randint(0, 40) if at_commit else None)
            world.computer.sleep(draw.uniform(0.2, 4.0))
            world.start_again()

    return happen


def _restarted(world: "World", draw: random.Random) -> None:
    with world.turn:
        world.stop()
        world.computer.sleep(draw.uniform(0.2, 4.0))
        world.start_again()


def _logger(spans: str) -> Fault:
    def happen(world: "World", draw: random.Random) -> None:
        now_ns, length_s = world.computer.now_ns, draw.choice((0.5, 5.0, 20.0))
        getattr(world.logger, spans).append((now_ns, now_ns + round(length_s * NS)))
        world.computer.sleep(length_s)

    return happen


FAULTS: dict[str, Fault] = {
    "fields lost on the bus": _camera(Kind.LOST, 0.1, 1.0, 5.0, shares=(0.02, 0.2, 0.5, 1.0)),
    "fields late": _camera(Kind.LATE, 0.5, 3.0, shares=(0.01, 0.05, 0.2)),
    "stall": _camera(Kind.STALL, 0.3, 1.0, 5.0),
    "stream fails": _camera(Kind.FAIL, 0.1, 2.0, 20.0),
    "unplugged": _camera(Kind.UNPLUGGED, 0.1, 2.0, 20.0),
    "no signal": _camera(Kind.NO_SIGNAL, 0.3, 3.0, 20.0),
    "computer frozen": _frozen,
    "computer busy": _busy,
    "threads starved": _starved,
    "clock set": _clock_set,
    "disk slow": _disk_slow,
    "disk hangs": _disk_hangs,
    "disk full": _refusing(Refusal.GROWTH, errno.ENOSPC, 1.0, 10.0, 40.0),
    "disk nearly full": _nearly_full,
    "disk fails to write": _refusing(Refusal.WRITES, errno.EIO, 0.1, 2.0, 20.0),
    "disk fails to synchronise": _refusing(Refusal.SYNCS, errno.EIO, 0.1, 2.0, 20.0),
    "disk fails to read": _refusing(Refusal.READS, errno.EIO, 0.1, 2.0, 20.0),
    "killed": _crash(power_cut=False, at_commit=False),
    "killed in a commit": _crash(power_cut=False, at_commit=True),
    "power cut": _crash(power_cut=True, at_commit=False),
    "power cut in a commit": _crash(power_cut=True, at_commit=True),
    "restarted": _restarted,
    "logger unplugged": _logger("gone"),
    "logger silent": _logger("silent"),
}
PAIRS = tuple(combinations_with_replacement(FAULTS, 2))
"""Every pair; a fault with itself comes twice."""
STRIDE = 97
"""Has few seeds meet many faults; it shares no factor with the number of pairs."""


def faults_of(seed: int, draw: random.Random) -> tuple[str, ...]:
    """The faults of a seed: pairs in turn, now and then with a third."""
    pair = PAIRS[seed * STRIDE % len(PAIRS)]
    return (*pair, draw.choice(list(FAULTS))) if draw.random() < 0.25 else pair
