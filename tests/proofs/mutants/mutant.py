"""A mutant, its outcome, and the files of lines that keep them."""

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from tests.house.source import ROOT

KEPT = Path(__file__).parent / "kept.jsonl"
OUTCOMES = ROOT / "build" / "mutants" / "outcomes.jsonl"
"""Outcomes of the current run, in the order of the run."""
KILLED, SURVIVED, TIMEOUT, NO_TESTS, CHANGED = "killed", "survived", "timeout", "no tests", "changed"
UNFINISHED = "unfinished"
"""Outcome of a mutant that survived the tests for which there was time."""
UNSOUND = "unsound"
"""Outcome of a mutant that was killed by a test which fails without any mutant as well."""


class Mutant(NamedTuple):
    """One change of one function; nothing in it says where the function is.

    Attributes:
        house: The function's house at the time it was chosen.
        function: Qualified name without the module.
        digest: Digest of the function's source.
        operator: Kind of change.
        place: Ordinal among the places of this operator in the function.
        change: Source of the place before and after, for readers.
    """

    house: str
    function: str
    digest: str
    operator: str
    place: int
    change: str


class Outcome(NamedTuple):
    """Fate of a mutant.

    Attributes:
        outcome: One of the words above; empty before the first run.
        test: The test that killed it.
        seconds: Processor time of its tests, which does not depend on what else the computer does.
    """

    outcome: str = ""
    test: str = ""
    seconds: float = 0.0

    @property
    def is_killed(self) -> bool:
        """True if a test noticed the mutant, by not ending if need be."""
        return self.outcome in (KILLED, TIMEOUT)


def line(mutant: Mutant, outcome: Outcome) -> str:
    """One line of JSON; what is empty is left out."""
    known = mutant._asdict() | {name: value for name, value in outcome._asdict().items() if value}
    return json.dumps(known, ensure_ascii=False, separators=(",", ":"))


def read(file: Path) -> dict[Mutant, Outcome]:
    """Mutants and their last outcomes; empty without the file."""
    return dict(_lines(file)) if file.exists() else {}


def _lines(file: Path) -> Iterator[tuple[Mutant, Outcome]]:
    for text in file.read_text(encoding="utf-8").splitlines():
        known = json.loads(text)
        mutant = Mutant(*(known.pop(name) for name in Mutant._fields))
        yield mutant, Outcome(**known)


def write(file: Path, outcomes: Iterable[tuple[Mutant, Outcome]]) -> None:
    """Replaces the file."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("".join(f"{line(*one)}\n" for one in outcomes), encoding="utf-8")


def append(mutant: Mutant, outcome: Outcome) -> None:
    """Adds an outcome to those of the current run."""
    OUTCOMES.parent.mkdir(parents=True, exist_ok=True)
    with OUTCOMES.open("a", encoding="utf-8") as file:
        file.write(f"{line(mutant, outcome)}\n")
