"""The daemon itself, frozen, starved and killed in real time; each capture is audited."""

import os
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

from grabberd.config import shipped_configs
from grabberd_fake.__main__ import audit
from grabberd_fake.faults import PERIOD_NS
from proofs.faults.daemon import RECORDED, Daemon

FREEZES_S = (0.3, 1.0, 3.0, 12.0, 30.0)
LOOPS, HOGS, KILLS = (4, 8), 2, 20
LOADED_S, HOGGED_S, QUIET_S = 8.0, 1.0, 1.5
_LOOP = "while True: pass"
_HOG = "import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))\nwhile True: pass"
_AT_MOST = re.compile(r"unknown, at most (\d+)")
_ON_THE_WAY = 3
"""Fields that a killed daemon may not have been given yet."""


class Row(NamedTuple):
    """What was done to the daemon, and what its account says of that.

    Attributes:
        fault: What was done.
        account: Words of the ledger.
        fields: Number of fields in it.
        uncertain: Number of those that are said to be uncertain.
        lies: What is wrong.
    """

    fault: str
    account: str
    fields: int
    uncertain: int
    lies: tuple[str, ...]


def all_rows(folder: Path) -> Iterator[Row]:
    """Everything, one after the other: some five minutes."""
    daemon = _daemon(folder / "suffering")
    try:
        for freeze_s in FREEZES_S:
            yield _frozen(daemon, freeze_s)
        for count in LOOPS:
            yield _beside(daemon, f"{count} busy loops", count, _LOOP, LOADED_S)
        hogs = f"{HOGS} real-time programs that compute for {HOGGED_S:g} s"
        yield _beside(daemon, hogs, HOGS, _HOG, HOGGED_S)
    finally:
        daemon.end()
    yield _killed(folder / "killed")


def _daemon(folder: Path) -> Daemon:
    configs = shipped_configs()
    cup: dict[str, Any] = {"driver": "fake", "options": {"scene": "liner"}}
    cup |= {"calibration": str(configs / "fake.calibration.json")}
    cup |= {"object": str(configs / "objects" / "liner.yaml")}
    daemon = Daemon(folder, {"devices": {"cup": cup}}, RECORDED, {})
    daemon.wait_until_ready()
    return daemon


def _frozen(daemon: Daemon, freeze_s: float) -> Row:
    capture_id = daemon.start_capture()
    time.sleep(QUIET_S)
    daemon.process.send_signal(signal.SIGSTOP)
    time.sleep(freeze_s)
    daemon.process.send_signal(signal.SIGCONT)
    time.sleep(QUIET_S)
    return _row(daemon, capture_id, f"frozen for {freeze_s:g} s")


def _beside(daemon: Daemon, fault: str, count: int, program: str, seconds: float) -> Row:
    capture_id = daemon.start_capture()
    time.sleep(QUIET_S)
    with _programs(count, program):
        time.sleep(seconds)
    time.sleep(QUIET_S)
    return _row(daemon, capture_id, fault)


@contextmanager
def _programs(count: int, program: str) -> Iterator[None]:
    started = [subprocess.Popen([sys.executable, "-c", program]) for _ in range(count)]
    try:
        yield
    finally:
        for one in started:
            one.kill()
            one.wait()


def _row(daemon: Daemon, capture_id: str, fault: str) -> Row:
    told = daemon.stop_capture(capture_id)
    found = audit(daemon.take_home(capture_id, daemon.folder))
    return Row(fault, told["ledger"]["in_words"], found.fields, found.uncertain, found.lies)


def _killed(folder: Path) -> Row:
    """As often as `KILLS`, some captures with a length and some without; one row for all."""
    draw, lies, fields, uncertain, cut = random.Random(1), list[str](), 0, 0, list[str]()
    for number in range(KILLS):
        home, length = folder / str(number), draw.choice([None, 200])
        daemon = _daemon(home)
        capture_id = daemon.start_capture(**({} if length is None else {"fields": length}))
        time.sleep(draw.uniform(0.2, 3.0))
        killed_ns = time.monotonic_ns()
        os.kill(daemon.process.pid, signal.SIGKILL)
        daemon.process.wait()
        daemon = _daemon(home)
        try:
            told = daemon.sealed(capture_id)
            path = daemon.take_home(capture_id, home)
        finally:
            daemon.end()
        found = audit(path)
        fields, uncertain = fields + found.fields, uncertain + found.uncertain
        lies += [*found.lies, *_of_the_tail(told, length, killed_ns)]
        cut.append("known" if length is not None else told["ledger"]["entries"][-1]["reason"])
    bounds = [int(found[1]) for words in cut if (found := _AT_MOST.search(words))]
    bounded = f"{len(bounds)} times at most {min(bounds)} to {max(bounds)} fields"
    words = f"tail known {len(cut) - len(bounds)} times, {bounded}"
    return Row(f"killed, {KILLS} times", words, fields, uncertain, tuple(lies))


def _of_the_tail(told: dict[str, Any], length: int | None, killed_ns: int) -> Iterator[str]:
    """What is said of the end of a killed capture must contain what is missing there."""
    counts = told["ledger"]["counts"]
    total = sum(counts.values())
    if length is not None:
        if total != length:
            yield f"{total} fields are in the account, {length} were ordered"
        return
    start_s = time.monotonic() - time.time()  # of CLOCK_MONOTONIC, whatever the wall clock began at
    begin_ns = (_seconds(told["created_utc"]) + start_s) * 1e9
    missing = (killed_ns - begin_ns) / PERIOD_NS - (total - 1)
    stated = _AT_MOST.search(told["ledger"]["entries"][-1]["reason"])
    if stated is None or int(stated[1]) < missing - _ON_THE_WAY:
        yield f"some {missing:.0f} fields are missing at the end, it says {stated and stated[1]}"


def _seconds(utc: str) -> float:
    return datetime.fromisoformat(utc).timestamp()


def table(rows: Sequence[Row]) -> str:
    """A Markdown table."""
    head = "| fault | what the ledger says | fields | uncertain | errors |\n|---|---|---|---|---|\n"
    return head + "".join(
        f"| {one.fault} | {one.account} | {one.fields} | {one.uncertain} | {len(one.lies)} |\n"
        for one in rows
    )
