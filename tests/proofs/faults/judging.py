"""Whether what became of a scenario is what it says."""

from collections import Counter
from collections.abc import Iterator

from grabberd.core.ledger import LedgerEntry, Outcome
from grabberd_fake.faults import FOREVER_S

from .scenario import Account, Scenario, Sees
from .suffering import PERIOD_S, Suffered

BUSY_S = 3.0
"""A machine that does much else may take so much longer; the table says how long it took."""
OF_THE_MACHINE = ("time gap", "sequence gap", "computer busy", "program stopped")
"""Why fields are lost where the whole computer stood still for longer than a driver's buffers bridge."""
UNCERTAIN = "number uncertain"
"""Reason of fields that are damaged because such a computer left too little to tell their number by."""
CAUSES = ("cause", "last_failure")
"""What is over within the fifth of a second between two events is shown as the last failure."""
BESIDE = 10
"""Fields before and after a fault that may belong to it."""


def problems_of(scenario: Scenario, suffered: Suffered) -> list[str]:
    """What is not as it has to be, in sentences."""
    problems = [*_of_sight(scenario.sees, suffered), *_of_times(scenario, suffered)]
    if scenario.refused is not None:
        said = suffered.refusal or "nothing"
        return problems if scenario.refused in said else [*problems, f"the capture's refusal says: {said}"]
    if suffered.evidence is None:
        return [*problems, f"no capture began: {suffered.refusal}"]
    problems += suffered.evidence.problems
    return [*problems, *_of_account(scenario, suffered)]


def _of_sight(sees: Sees, suffered: Suffered) -> Iterator[str]:
    shown = [one.state for one in suffered.seen]
    states = iter([device["state"] for device in shown])
    if not all(wanted in states for wanted in sees.states):
        yield f"states were {_in_turn([device['state'] for device in shown])}, not {', '.join(sees.states)}"
    for keys, wanted in ((CAUSES, sees.cause), (("hint",), sees.hint), (("signal",), sees.signal)):
        said = {device[key] for device in shown for key in keys if device[key]}
        if wanted is not None and not any(wanted in words for words in said):
            yield f"no {keys[0]} says {wanted!r}: {sorted(said)}"
    taken = Counter(shown[-1]["recoveries"]) - Counter(shown[0]["recoveries"])
    yield from (
        f"{taken[rung]} × {rung}, not {count}" for rung, count in sees.steps.items() if taken[rung] < count
    )
    stream = shown[-1]["stream"] or {"details": {}, "buffers": None}
    if sees.node is not None and stream["details"].get("node") != sees.node:
        yield f"it is there as {stream['details'].get('node')}, not {sees.node}"
    if sees.buffers is not None and stream["buffers"] != sees.buffers:
        yield f"it is said to have {stream['buffers']} buffers"


def _of_times(scenario: Scenario, suffered: Suffered) -> Iterator[str]:
    wanted = (
        ("noticed", suffered.noticed_s, scenario.noticed_within_s),
        ("recovered", suffered.recovered_s, scenario.recovered_within_s),
    )
    for word, took_s, limit_s in wanted:
        if limit_s is not None and (took_s is None or took_s > limit_s + BUSY_S):
            yield f"{word} after {took_s} s, wanted within {limit_s} s"


def _of_account(scenario: Scenario, suffered: Suffered) -> Iterator[str]:
    assert suffered.evidence is not None
    assert suffered.capture is not None
    entries = of_the_fault(suffered)
    yield from _of_entries(scenario.ledger, entries)
    if not suffered.alone:
        return
    beside = [entry for entry in suffered.evidence.ledger.entries if entry not in entries]
    yield from (f"beside the fault: {entry}" for entry in beside if not of_the_machine(entry))
    verdict = "complete" if suffered.evidence.ledger.complete else "incomplete"
    said, because = suffered.capture["verdict"], suffered.capture["ended_because"] or ""
    if said != verdict and not (verdict == "complete" and scenario.ledger.ended_because):
        yield f"the verdict is {said}, the ledger's {verdict}"
    if (
        scenario.ledger.ended_because or "stopped by the operator"
    ) not in because and not scenario.from_start:
        yield f"it ended because: {because}"


def of_the_machine(entry: LedgerEntry) -> bool:
    """True if a busy computer may cost such fields, whatever else happens."""
    return entry.reason.startswith((*OF_THE_MACHINE, UNCERTAIN))


def of_the_fault(suffered: Suffered) -> list[LedgerEntry]:
    """The ledger's entries of the time of the fault, until fields came again."""
    assert suffered.evidence is not None
    if suffered.evidence.camera_n is None or not suffered.begin_s:
        return list(suffered.evidence.ledger.entries)
    until_s = suffered.end_s + (suffered.recovered_s or FOREVER_S)
    first, last = suffered.begin_s / PERIOD_S, until_s / PERIOD_S
    return suffered.evidence.entries_between(first - BESIDE, last + BESIDE)


def _of_entries(account: Account, entries: list[LedgerEntry]) -> Iterator[str]:
    counts: Counter[Outcome] = Counter()
    for entry in entries:
        counts[entry.outcome] += 0 if entry.reason.startswith(UNCERTAIN) else entry.count
    for outcome in sorted(counts.keys() | account.fields.keys()):
        least, most = account.fields.get(outcome, (0, 0))
        if not least <= counts[outcome] <= most:
            yield f"{counts[outcome]} fields {outcome}, wanted {least} to {most}: {entries}"
    if account.because is not None and not any(account.because in entry.reason for entry in entries):
        yield f"no reason says {account.because!r}: {entries}"


def _in_turn(states: list[str]) -> str:
    turns = [state for state, before in zip(states, [None, *states], strict=False) if state != before]
    return ", ".join(turns)
