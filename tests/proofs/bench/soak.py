"""The daemon at 50 Hz for long, with clients that come and go, and captures of all kinds; then its files."""

import os
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from grabberd.core.ledger import Outcome

from .daemon import Cost, Daemon, daemon, resident_mb
from .live import cost_rows, in_words_ms
from .soak_check import Checked, check_captures, in_words
from .soak_crowd import Crowd, crowd
from .witness import Stalls, witness

SETTLE_S = 5.0
SEED = 1
RING_MS = 640.0
FIELD_S = 0.02
GROWTH_MB = 12.0
"""What memory may grow by from the middle third to the last: more than that is no warming up."""
SAMPLES = 120


class Soak(NamedTuple):
    """Rows of a table, and what was promised and is not so."""

    rows: list[tuple[str, str]]
    broken: list[str]

    def table(self) -> str:
        """As Markdown."""
        verdict = ("verdict", "; ".join(self.broken) or "every promise kept")
        return "\n".join(
            ["| | |", "|---|---|", *(f"| {name} | {text} |" for name, text in [*self.rows, verdict])]
        )


class Seen(NamedTuple):
    """What was seen of the daemon while it ran.

    Attributes:
        outcomes: of all fields; `latency_ms`: of the newest ones, at most half an hour.
        memory_mb: resident, from beginning to end.
        stalls: of the machine; `waited_s`: how long the capture thread waited for a core.
        shares: of a core.
        load: of the machine in the minute before the end, processes ready to run.
    """

    outcomes: Counter[Outcome]
    latency_ms: np.ndarray
    memory_mb: list[float]
    stalls: Stalls
    waited_s: float
    shares: dict[str, float]
    load: float


def soak(seconds: float, seed: int = SEED) -> Soak:
    """Runs it; the seed decides who comes when, and which captures are ordered."""
    with tempfile.TemporaryDirectory() as folder:
        with daemon(Path(folder)) as running:
            running.wait_until_ready()
            time.sleep(SETTLE_S)
            with witness() as watching, crowd(running.port, seed) as here:
                time.sleep(SETTLE_S)
                seen = _watched(running, seconds)
            seen = seen._replace(stalls=watching.stalls)
        checked = check_captures(Path(folder) / "captures")
    rows = [("length", f"{seconds:.0f} s"), *_rows(seen), *here.rows(), *_file_rows(checked)]
    return Soak(rows, [*broken(seen), *_broken_by(here), *in_words(checked)])


def _watched(running: Daemon, seconds: float) -> Seen:
    instrument = running.instrument
    assert instrument.worker
    before, cost, memory = instrument.board.now.outcomes, Cost(running.grabber), [resident_mb()]
    for _ in range(SAMPLES):
        time.sleep(seconds / SAMPLES)
        memory.append(resident_mb())
    return Seen(
        instrument.board.now.outcomes - before,
        instrument.worker.latency.milliseconds(round(seconds / FIELD_S)),
        memory,
        Stalls(0.0, 0),
        cost.waited_s(),
        cost.shares(),
        os.getloadavg()[0],
    )


def broken(seen: Seen) -> Iterator[str]:
    """Which promises about the running daemon are broken, in sentences.

    A field may be missing only where the machine itself stood still, or had no core for the capture thread.
    """
    missing = sum(seen.outcomes.values()) - seen.outcomes[Outcome.RECEIVED]
    if missing * FIELD_S > seen.waited_s + seen.stalls.longest_s:
        yield f"{missing} fields did not come whole, and the machine does not explain it"
    if growth_mb(seen.memory_mb) > GROWTH_MB:
        yield f"memory has grown by {growth_mb(seen.memory_mb):.0f} MB"
    p99 = float(np.percentile(seen.latency_ms, 99)) if len(seen.latency_ms) else np.inf
    if p99 > RING_MS + 1e3 * (seen.waited_s + seen.stalls.longest_s):
        yield f"one field in a hundred is later than {p99:.0f} ms"


def growth_mb(memory_mb: list[float]) -> float:
    """Median of the last third, less that of the third before."""
    third = len(memory_mb) // 3
    return float(np.median(memory_mb[-third:]) - np.median(memory_mb[-2 * third : -third]))


def _broken_by(here: Crowd) -> Iterator[str]:
    yield from here.failures
    for failure, count in Counter(one.failure for one in here.visits if one.failure).items():
        yield f"{failure} ({count} times)"


def _rows(seen: Seen) -> list[tuple[str, str]]:
    missing = {name: count for name, count in seen.outcomes.items() if name is not Outcome.RECEIVED and count}
    lost = ", ".join(f"{count} {name}" for name, count in missing.items()) or "none"
    memory = (seen.memory_mb[0], max(seen.memory_mb), seen.memory_mb[-1])
    return [
        ("load of the machine (two cores: 2 is all)", f"{seen.load:.1f}"),
        ("fields received", str(seen.outcomes[Outcome.RECEIVED])),
        ("fields that did not come whole (goal: none)", lost),
        ("longest stall of the machine, seen by a witness process", f"{seen.stalls.longest_s * 1e3:.0f} ms"),
        ("stalls over 20 ms that the witness saw", str(seen.stalls.long_ones)),
        ("the capture thread waited for a core", f"{seen.waited_s:.1f} s"),
        ("field arrived → points published, p50 / p99 / max (goal: 5 / 40)", in_words_ms(seen.latency_ms)),
        *cost_rows([seen.shares]),
        ("resident memory, start / highest / end", " / ".join(f"{m:.0f} MB" for m in memory)),
        ("memory, last third less the third before", f"{growth_mb(seen.memory_mb):+.1f} MB"),
    ]


def _file_rows(checked: list[Checked]) -> list[tuple[str, str]]:
    complete = sum(one.complete for one in checked)
    fields = f"{sum(one.received for one in checked)} of {sum(one.total for one in checked)}"
    return [
        ("captures, of them complete", f"{len(checked)}, {complete}"),
        ("fields in them that came whole and decode", fields),
        ("of them with points", str(sum(one.measured for one in checked))),
        ("files with a fault", str(sum(bool(one.faults) for one in checked))),
    ]
