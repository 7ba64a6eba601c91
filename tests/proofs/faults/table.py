"""The table of faults, as `docs/reference/faults.md` has it."""

import os
from collections.abc import Iterable, Mapping, Sequence

from .finding import Finding
from .judging import CAUSES, of_the_fault
from .scenario import Scenario
from .suffering import Suffered

HEAD = """# Faults: how they are noticed and recovered from

Made by `make faults`; do not edit. Every fault is injected into a complete daemon, a separate process reached
over HTTP, during a capture. Every row is a test that also checks the capture's file: its ledger adds up,
every field has the number that its picture shows, and points are present or accounted for.

Noticed: from the start of the fault until the event stream, which is updated five times a second, shows it.
Recovered: from the end of the fault (or from its start, where only the daemon can end it) until fields arrive
again. The goals are 1 s and 3 s. An overloaded computer is slower and loses fields of its own ("computer
busy", or "time gap" where there is no evidence of the cause): during this run
{load:.1f} programs were waiting for {processors} processors.

## Faults of a grabber

Injected into the simulated grabber by the scripts in `tests/proofs/faults/scenarios/`. A capture that loses
fields continues with the gap in its ledger, unless it was told to end.
"""
MACHINE = """
## Faults of the computer and of clients

One device is measured at 50 Hz; the recorder's queue and the clients' timeouts are shortened.
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
