"""The installed service for a day of the machine's time, with a fault every minute, by lot.

PYTHONPATH=tests python -m proofs.vm.months [--hours N] [--seed N] --log FILE   runs it, a line for each fault
python -m tests.proofs.months summary FILE --write docs/reference/months-of-the-service.md
"""

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from random import Random
from typing import Any

from proofs.months.log import Lived, Played, broken, read_lines, summary, write_line
from proofs.vm.guest import client, faults, unit
from proofs.vm.image import cached_image
from proofs.vm.installed import Installed

MINUTE_S = 60.0
BEFORE_FIELDS = 50
ALARM_S = 60.0
LOST_AT_MOST_S = 1.0
OF_THE_AGENT = "process stopped"
"""Faults of the guest's list that stop whoever plays them, not the service."""


class Months:
    """One service, and the account of what it suffers; `tell` is given each entry as it is made."""

    def __init__(self, installed: Installed, tell: Callable[[Played | Lived], None]) -> None:
        self._installed, self._tell = installed, tell
        self._at_s = 0.0
        self._fields: Counter[str] = Counter()
        self._captures = 0
        self._sizes: list[Mapping[str, Any]] = []
        self._call(client.write_clock, path="/share/clock")

    def minute(self, fault: str) -> None:
        """A capture, a fault in its midst, and what is left of it."""
        self._call(unit.until_ready, timeout_s=900)
        capture_id = self._call(client.running, fields=BEFORE_FIELDS)
        cut_ns = ALL[fault](self)
        self._call(unit.until_ready, timeout_s=900)
        document = self._call(client.document, capture_id=capture_id)
        if document["state"] in client.RUNNING:
            document = self._call(client.stopped, capture_id=capture_id)
        inside = self._call(client.inside, capture_id=capture_id)
        problems = [
            *_wrong_with(document, inside, cut_ns),
            *self._call(client.alarms, within_s=ALARM_S, timeout_s=600),
        ]
        if (status := self._call(client.deleted, capture_id=capture_id)) >= 300:
            problems.append(f"the capture is not deleted: {status}")
        self._fields.update(document["ledger"]["counts"])
        self._captures += 1
        self._tell(Played(fault, self._at_s, problems=problems))
        self._count("gone" if cut_ns else "")
        self._call(unit.idle, seconds=max(1.0, MINUTE_S / 4))
        self._at_s += MINUTE_S

    def happen(self, name: str) -> None:
        """A fault of the grabber."""
        self._call(faults.happen, name=name)

    def strike(self, name: str) -> int:
        """The daemon is sent a signal; when."""
        return int(self._call(unit.struck, name=name, timeout_s=900)["at_ns"])

    def cut_power(self) -> int:
        """The machine is gone, and booted again; when it went."""
        self._call(unit.settle_disks)
        cut_ns = int(self._installed.power_cut().split()[-2])
        self._installed.boot()
        self._call(unit.until_ready, timeout_s=900)
        self._call(client.write_clock, path="/share/clock")
        return cut_ns

    def fill_disk(self) -> None:
        """No byte is left for some seconds."""
        self._call(unit.fill_disk, leave_bytes=0)
        self._call(unit.idle, seconds=5.0)
        self._call(unit.free_disk)

    def break_disk(self) -> int:
        """The kernel lets nobody write until it is mended; since when."""
        broken_ns = int(self._call(unit.break_disk))
        self._call(unit.idle, seconds=5.0)
        self._call(unit.mend_disk, timeout_s=900)
        self._call(unit.systemctl, verb="start", timeout_s=900)
        return broken_ns

    def step_clock(self, hours: float) -> None:
        """The time of day is set."""
        self._call(unit.step_clock, hours=hours)
        self._call(unit.idle, seconds=2.0)

    def end(self) -> None:
        """Tells of the last process."""
        self._count("told to end", is_last=True)

    def _count(self, end: str, *, is_last: bool = False) -> None:
        """Takes the size of the daemon, and tells of one whose place another has taken."""
        size = self._call(unit.size_of_daemon)
        if self._sizes and (is_last or self._sizes[-1]["pid"] != size["pid"]):
            memory_mb = [one["memory_mb"] for one in self._sizes]
            descriptors = [one["descriptors"] for one in self._sizes]
            self._tell(
                Lived(
                    end or "replaced", self._at_s, self._captures, dict(self._fields), memory_mb, descriptors
                )
            )
            self._sizes, self._captures, self._fields = [], 0, Counter()
        self._sizes.append(size)

    def _call(self, function: Callable[..., Any], **arguments: Any) -> Any:
        return self._installed.machine.call(function, **arguments)


def _wrong_with(document: Mapping[str, Any], inside: Mapping[str, Any], cut_ns: int | None) -> list[str]:
    """What does not add up in a capture that has been sealed; `cut_ns`: when it was cut off."""
    counts = document["ledger"]["counts"]
    lost_s = 0.0 if cut_ns is None else (cut_ns - inside["last_ns"]) / 1e9
    facts = {
        f"it is {document['state']}": document["state"] == "sealed",
        f"the file's integrity: {inside['integrity']}": inside["integrity"] == "ok",
        f"{inside['received']} fields are in the file, {counts['received']} were received": inside["received"]
        == counts["received"],
        f"{lost_s:.1f} s before it was cut off are missing": lost_s <= LOST_AT_MOST_S,
        f"{inside['received']} fields of {BEFORE_FIELDS} before the fault": inside["received"]
        >= BEFORE_FIELDS
        or cut_ns is not None,
        "it was cut off, and says it is complete": cut_ns is None or document["verdict"] != "complete",
    }
    return [words for words, is_so in facts.items() if not is_so]


def _of_grabber(name: str) -> Callable[[Months], int | None]:
    def play(months: Months) -> None:
        months.happen(name)

    return play


ALL: Mapping[str, Callable[[Months], int | None]] = {
    **{name: _of_grabber(name) for name in faults.FAULTS if not name.startswith(OF_THE_AGENT)},
    "the daemon is killed": lambda months: months.strike("SIGKILL"),
    "the daemon stands still": lambda months: months.strike("SIGSTOP"),
    "the power is cut": lambda months: months.cut_power(),
    "the disk is full to the last byte": lambda months: months.fill_disk(),
    "the disk becomes read-only": lambda months: months.break_disk(),
    "the clock is set on by an hour": lambda months: months.step_clock(1.0),
    "the clock is set back by an hour": lambda months: months.step_clock(-1.0),
}
"""What can happen; the time of a cut, where there is one that may cost the last second."""


def by_lot(seed: int, minutes: int) -> list[str]:
    """A fault for each minute: all of them before any comes again."""
    random, found = Random(seed), list[str]()
    while len(found) < minutes:
        found += random.sample(sorted(ALL), len(ALL))
    return found[:minutes]


def main() -> int:
    """Runs it; 1 where a promise was broken."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--log", type=Path, required=True)
    options = parser.parse_args()
    installed = Installed(cached_image())
    try:
        installed.machine.resume()
        months = Months(installed, lambda entry: write_line(options.log, entry))
        for fault in by_lot(options.seed, round(options.hours * 60)):
            months.minute(fault)
        months.end()
    finally:
        installed.close()
    entries = read_lines(options.log)
    print(summary(entries))
    return int(any(broken(entries)))


if __name__ == "__main__":
    sys.exit(main())
