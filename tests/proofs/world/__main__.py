"""`python -m tests.proofs.world [--seeds N]`: plays worlds by their seeds; fails on a single lie.

    --seeds 100            seeds 0 to 99; 100:200 those from 100 on; 4,14 these
    --fault NAME           only this fault, again and again, in place of pairs
    --write FILE           the table for the documentation

A lie is printed with its seed and the commit; `--seeds SEED:SEED+1` plays it again, to the letter.
"""

import argparse
import gc
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING

from .disk import library
from .weather import FAULTS

if TYPE_CHECKING:  # imported once the disk's library is loaded
    from .world import Outcome

HEAD = """# Worlds

Made by `make world`; do not edit. {runs} worlds, {hours:.0f} hours of a barn in {fields} fields and
{captures} captures, at {speed:.0f} simulated seconds a second of one processor. A world is the whole daemon
without HTTP, with one or two cameras whose pictures are numbers, a logger, an operator, a page and a
researcher, in simulated time: one thread runs at a time, chosen by the seed. For a minute two or three of the
faults below meet; in the calm after that an auditor holds the daemon to what it has promised. There are
**{lies} lies**.

| fault, with every other | worlds | fields | captures | jobs | lies |
|---|---|---|---|---|---|
"""


Job = tuple[int, tuple[str, ...] | None, float]
"""Seed, faults and length of the storm."""


def main() -> int:
    """Plays; the table goes to the terminal, or into a file."""
    parser = argparse.ArgumentParser(description="The whole daemon in simulated weather.")
    parser.add_argument("--seeds", default="100", help="how many, FIRST:END, or SEED,SEED")
    parser.add_argument("--fault", choices=list(FAULTS), help="only this one")
    parser.add_argument("--write", type=Path, help="the page of the documentation")
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    parser.add_argument("--traces", action="store_true", help="the hash of each world's decisions")
    parser.add_argument("--hours", type=float, default=0.0, help="length of the storm, for a month of a barn")
    parser.add_argument("--minutes", type=float, default=1e6, help="begin no world after that")
    given = parser.parse_args()
    preload("tests.proofs.world")
    faults = (given.fault,) if given.fault else None
    jobs = ((seed, faults, given.hours * 3600 or 60.0) for seed in _seeds(given.seeds))
    found = list(_all(jobs, given.processes, time.monotonic() + given.minutes * 60))
    if given.traces:
        print("".join(f"trace {one.seed} {one.trace:016x}\n" for one in found), end="")
    if given.hours:
        print("".join(f"memory {one.seed}: %.0f → %.0f MB\n" % one.megabytes for one in found), end="")
    page = _page(found)
    given.write.write_text(page, encoding="utf-8") if given.write else print(page)
    return any(one.lies for one in found)


def _seeds(given: str) -> Sequence[int]:
    if "," in given:
        return [int(seed) for seed in given.split(",")]
    first, _, end = given.rpartition(":")
    return range(int(first or 0), int(end))


def preload(module: str) -> None:
    """Starts again with the disk's library, and with hashes of texts that are the same every time."""
    if "disk_log.so" not in os.environ.get("LD_PRELOAD", ""):
        environment = {
            **os.environ,
            "LD_PRELOAD": str(library()),
            "PYTHONHASHSEED": "0",
            "OPENBLAS_NUM_THREADS": "1",
        }
        os.execve(sys.executable, [sys.executable, "-m", module, *sys.argv[1:]], environment)


def _all(jobs: Iterator[Job], processes: int, until_s: float) -> Iterator["Outcome"]:
    """Plays each seed in a process of its own, that has imported everything."""
    from . import world  # noqa: F401, PLC0415 - before the processes fork

    commit = _commit()  # now: beside processes that fork, a command may wait for them for ever
    gc.collect()
    gc.freeze()
    with in_memory(), get_context("fork").Pool(processes, maxtasksperchild=1) as pool:
        for outcome in pool.imap_unordered(partial(_played, until_s), jobs, chunksize=1):
            if outcome is not None:
                _print(outcome, commit)
                yield outcome


@contextmanager
def in_memory() -> Iterator[None]:
    """Has worlds keep their disks in memory: the computer's own would only be waited for."""
    with tempfile.TemporaryDirectory(dir="/dev/shm") as folder:
        tempfile.tempdir = folder
        yield
        tempfile.tempdir = None


def _played(until_s: float, job: Job) -> "Outcome | None":
    from .world import played  # noqa: PLC0415

    return played(*job) if time.monotonic() < until_s else None


def _print(outcome: "Outcome", commit: str) -> None:
    for lie in outcome.lies:
        print(f"seed {outcome.seed} ({', '.join(outcome.faults)}) at {commit}: {lie}", flush=True)
    print(".", end="", file=sys.stderr, flush=True)


def _commit() -> str:
    asked = ["git", "describe", "--always", "--dirty"]
    done = subprocess.run(asked, capture_output=True, text=True, check=False)
    return done.stdout.strip()


def _page(found: Sequence["Outcome"]) -> str:
    head = HEAD.format(
        runs=len(found),
        hours=sum(one.simulated_s for one in found) / 3600,
        fields=sum(one.fields for one in found),
        captures=sum(one.captures for one in found),
        speed=sum(one.simulated_s for one in found) / max(sum(one.processor_s for one in found), 1e-9),
        lies=sum(len(one.lies) for one in found),
    )
    return head + "".join(_row(fault, [one for one in found if fault in one.faults]) for fault in FAULTS)


def _row(fault: str, found: Sequence["Outcome"]) -> str:
    sums = (
        sum(one.fields for one in found),
        sum(one.captures for one in found),
        sum(one.jobs for one in found),
        sum(len(one.lies) for one in found),
    )
    return f"| {fault} | {len(found)} | {' | '.join(map(str, sums))} |\n"


if __name__ == "__main__":
    sys.exit(main())
