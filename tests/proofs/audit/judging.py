"""Whether the account of a run is true."""

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from grabberd.core.ledger import UNCERTAIN, LedgerEntry, too_high_by
from grabberd_fake.audit import Audit, audit
from grabberd_fake.faults import PERIOD_NS

from .cases import Case, drawn
from .causes import wrong_causes
from .simulation import Simulation

_AT_AN_EDGE = 1
"""Fields by which begin and end may be off together with their jitter."""


class Verdict(NamedTuple):
    """A run and what came of its audit.

    Attributes:
        case: What went wrong.
        found: The audit of its file.
        complete: True if the account says that nothing is missing.
        lies: All that is not as it says.
    """

    case: Case
    found: Audit
    complete: bool
    lies: tuple[str, ...]


def judged(seed: int) -> Verdict:
    """Runs the case of a seed, and audits its file."""
    return judged_case(drawn(seed))


def judged_case(case: Case) -> Verdict:
    """Runs a case, and audits its file."""
    simulation = Simulation(case)
    simulation.run()
    assert simulation.recorder is not None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.grab"
        simulation.write(path)
        found = audit(path)
    ledger = simulation.recorder.ledger
    causes = tuple(wrong_causes(case, ledger))
    return Verdict(case, found, ledger.complete, (*found.lies, *_of_the_end(simulation), *causes))


def _of_the_end(simulation: Simulation) -> tuple[str, ...]:
    """The account goes on to the end that was asked for: by its own numbers if that was a length, and by the
    camera's if it was stopped.
    """
    assert simulation.recorder is not None
    ledger, length = simulation.recorder.ledger, simulation.case.fields
    end_n = ledger.end_n or 0
    if _is_open(ledger.entries, end_n):
        return ()  # what is uncertain to the end leaves open how many fields there were
    begin_n = math.ceil((simulation.start_ns - simulation.before * PERIOD_NS) / PERIOD_NS)
    stopped = math.ceil(simulation.stop_ns / PERIOD_NS) - begin_n if simulation.stop_ns else math.inf
    camera_n = end_n - sum(too_high_by(event) for event in ledger.events)
    if end_n == length or abs(camera_n - stopped) <= _AT_AN_EDGE:
        return ()
    wanted = min(length or math.inf, stopped)
    return (f"its account ends after {end_n} fields, {wanted} were asked for",)


def _is_open(entries: Sequence[LedgerEntry], end_n: int) -> bool:
    """True if the last field that came is said to be uncertain."""
    for entry in reversed(entries):
        if entry.end_n != end_n:
            return False
        if entry.reason.startswith(UNCERTAIN):
            return True
        end_n = entry.first_n
    return False
