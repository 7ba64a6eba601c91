"""The table of faults, as `docs/reference/faults.md` has it."""

import os
from collections.abc import Iterable, Mapping, Sequence

from .finding import Finding
from .judging import CAUSES, of_the_fault
from .scenario import Scenario
from .suffering import Suffered

HEAD = """# Faults

Made by `make faults`; do not edit. Every fault is done to the whole daemon, a process of its own reached over
HTTP, in the midst of a capture; every row is a test, which also opens the capture's file: its ledger adds up,
every field stands where the number in its picture says, and points are there or named.

Noticed: from the fault's beginning until the event stream shows something of it, which it does five times a
second. Recovered: from the fault's end, or from its beginning where only the daemon ends it, until fields
come again. Wanted are 1 s and 3 s. A computer that has more to do than it can is slower, and loses fields by
itself ("computer busy"; "time gap" where no evidence tells): this run
had {load:.1f} programs waiting for {processors} processors.

## Of a grabber

On the simulated one; `tests/faults/scenarios/` has their scripts. Where a capture loses fields, it goes on
with the gap in its ledger unless it was told to end.
"""
MACHINE = """
## Of the machine and of clients

One device at 50 Hz that is measured; the recorder's queue and the patience with clients are shortened.
"""
Row = Sequence[str]


def document(
    scenarios: Iterable[Scenario], suffered: Mapping[str, Suffered], findings: Mapping[str, Finding]
) -> str:
    """The whole page."""
    grabbers = [_of_grabber(one, suffered[one.name]) for one in scenarios]
    machine = [
        (fault, one.behaviour, _seconds(one.noticed_s), _seconds(one.recovered_s))
        for fault, one in findings.items()
    ]
    head = ("fault", "what the operator is shown", "what the ledger says", "noticed, s", "recovered, s")
    return (
        HEAD.format(load=os.getloadavg()[0], processors=os.cpu_count())
        + _table(head, grabbers)
        + MACHINE
        + _table(("fault", "behaviour", "noticed, s", "recovered, s"), machine)
    )


def _of_grabber(scenario: Scenario, one: Suffered) -> Row:
    return (
        scenario.fault,
        _shown(scenario, one),
        _ledger(one),
        _seconds(None if scenario.from_start else one.noticed_s),
        _seconds(one.recovered_s if one.noticed_s is not None and not scenario.from_start else None),
    )


def _shown(scenario: Scenario, one: Suffered) -> str:
    """States in turn, what was said of them, and the steps that were taken."""
    shown = [each.state for each in one.seen]
    states = [each["state"] for each in shown]
    turns = [state for state, before in zip(states, [None, *states], strict=False) if state != before]
    said = dict.fromkeys(each[key] for each in shown for key in CAUSES if each[key])
    first, last = shown[0]["recoveries"], shown[-1]["recoveries"]
    steps = [f"{last[rung] - first[rung]} × {rung}" for rung in last if last[rung] > first[rung]]
    words = [" → ".join(turns), *said, ", ".join(steps)]
    if scenario.sees.node is not None:
        words.append(f"there again as {scenario.sees.node}")
    return "; ".join(word for word in words if word)


def _ledger(one: Suffered) -> str:
    if one.refusal is not None:
        return f"no capture begins: {one.refusal}"
    entries = of_the_fault(one)
    words = [f"{entry.count} {entry.outcome} ({entry.reason})" for entry in entries[:4]]
    if len(entries) > len(words):
        words.append(f"{sum(entry.count for entry in entries[4:])} more")
    because = (one.capture or {}).get("ended_because") or ""
    ended = [] if because in ("stopped by the operator", "length reached") else [f"it ended: {because}"]
    return "; ".join([*words, *ended]) or "complete"


def _seconds(seconds: float | None) -> str:
    return "–" if seconds is None else f"{max(0.0, seconds):.2f}"


def _table(head: Row, rows: Sequence[Row]) -> str:
    lines = [f"| {' | '.join(cell.replace('|', '/') for cell in row)} |" for row in (head, *rows)]
    return "\n" + "\n".join([lines[0], "|" + "---|" * len(head), *lines[1:]]) + "\n"
