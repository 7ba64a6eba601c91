"""Seeded mutants of functions, and the tests that notice them.

python -m tests.proofs.mutants choose --seed 1 [--write]    chooses the mutants, and with --write keeps them
python -m tests.proofs.mutants run [--only-new] [--house core] [--seconds N]
python -m tests.proofs.mutants confirm                      runs the tests that killed, without any mutant
python -m tests.proofs.mutants compare                      names those that were killed before, not now
python -m tests.proofs.mutants keep                         keeps the outcomes of the run in the list

A run can be stopped and continued with --only-new; its outcomes are in build/mutants until they are kept.
"""

import argparse
import random
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping

from tests.house.source import ROOT, modules, tree

from .choosing import HOUSES, chosen
from .functions import Catalogue
from .mutant import (
    CHANGED,
    KEPT,
    NO_TESTS,
    OUTCOMES,
    SURVIVED,
    UNFINISHED,
    UNSOUND,
    Mutant,
    Outcome,
    append,
    read,
    write,
)
from .mutated import mutated
from .nearest import Nearest
from .running import judged, preload

ALIVE = (SURVIVED, UNFINISHED, NO_TESTS)
CONFIRMING = ("-q", "-rfE", "--tb=no", "--no-header", "-m", "not slow", "-p", "no:cacheprovider")
"""Options of the run that names tests which fail without a mutant."""


def main() -> int:
    """Does what was asked; the status is 1 if a mutant survives that was killed before."""
    asked = _arguments()
    tasks = {"choose": _choose, "run": _run, "confirm": _confirm, "compare": _compare, "keep": _keep}
    return tasks[asked.task](asked)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tests.proofs.mutants",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("task", choices=("choose", "run", "confirm", "compare", "keep"))
    parser.add_argument("--seed", type=int, default=1, help="of the choice (default: %(default)s)")
    parser.add_argument("--write", action="store_true", help="replace the kept mutants by the chosen ones")
    parser.add_argument("--only-new", action="store_true", help="leave out those of which the run knows")
    parser.add_argument("--house", choices=HOUSES, help="one house alone")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin no mutant after this time")
    return parser.parse_args()


def _choose(asked: argparse.Namespace) -> int:
    mutants = list(chosen(_catalogue(), asked.seed))
    print(*(f"{one.house}: {one.function}: {one.change}" for one in mutants), sep="\n")
    if asked.write:
        write(KEPT, ((one, Outcome()) for one in mutants))
    return 0


def _catalogue() -> Catalogue:
    return Catalogue({name: tree(path) for name, path in modules().items()})


def _run(asked: argparse.Namespace) -> int:
    known = _begun(asked.only_new)
    unsound = [one.test for one in known.values() if one.outcome == UNSOUND]
    asked_for = HOUSES if asked.house is None else (asked.house,)
    todo = [one for one in read(KEPT).items() if one[0].house in asked_for and _is_due(one[0], known)]
    random.Random(0).shuffle(todo)  # of a run that is stopped, every house has its share
    catalogue, nearest = _catalogue(), Nearest()
    preload()
    end = time.monotonic() + asked.seconds
    for mutant, before in todo:
        if time.monotonic() > end:
            break
        outcome = _tried(mutant, before, catalogue, nearest, unsound)
        append(mutant, outcome)
        print(f"{outcome.outcome:9} {outcome.seconds:5} s  {mutant.function}: {mutant.change}", flush=True)
    _tell(read(OUTCOMES))
    return 0


def _begun(only_new: bool) -> dict[Mutant, Outcome]:
    if not only_new:
        OUTCOMES.unlink(missing_ok=True)
    return read(OUTCOMES)


def _is_due(mutant: Mutant, known: Mapping[Mutant, Outcome]) -> bool:
    return known.get(mutant, Outcome(UNSOUND)).outcome == UNSOUND


def _tried(
    mutant: Mutant, before: Outcome, catalogue: Catalogue, nearest: Nearest, unsound: list[str]
) -> Outcome:
    found = catalogue.found(mutant.function, mutant.digest)
    if not found:
        return Outcome(CHANGED)
    path = modules()[found[0].module].relative_to(ROOT)
    tests = nearest.tests(path, found[0], before.test)
    if not tests:
        return Outcome(NO_TESTS)
    return judged({one.module: mutated(modules()[one.module], mutant) for one in found}, tests, unsound)


def _confirm(_: argparse.Namespace) -> int:
    """Every test that kills has to pass without a mutant; those that do not are named and do not count."""
    outcomes = read(OUTCOMES)
    tests = sorted({one.test for one in outcomes.values() if one.is_killed and one.test})
    unsound = set(_failing(tests))
    print(f"{len(tests)} tests kill, {len(unsound)} fail without a mutant:", *sorted(unsound), sep="\n")
    write(OUTCOMES, ((mutant, _without(outcome, unsound)) for mutant, outcome in outcomes.items()))
    return 0


def _without(outcome: Outcome, unsound: Iterable[str]) -> Outcome:
    return outcome._replace(outcome=UNSOUND) if outcome.test in unsound else outcome


def _failing(tests: Iterable[str]) -> Iterator[str]:
    names = OUTCOMES.with_name("tests.txt")
    names.write_text("\n".join(tests), encoding="utf-8")
    command = [sys.executable, "-m", "pytest", *CONFIRMING, f"@{names}"]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    for one in run.stdout.splitlines():
        if one.startswith(("FAILED ", "ERROR ")):
            yield one.partition(" ")[2].partition(" - ")[0]


def _compare(_: argparse.Namespace) -> int:
    kept = read(KEPT)
    now = {one: outcome for one, outcome in read(OUTCOMES).items() if one in kept}
    _tell(now)
    lost = [one for one, outcome in now.items() if kept[one].is_killed and outcome.outcome in ALIVE]
    for one in lost:
        print(f"killed before, {now[one].outcome} now: {_described(one)}; before by {kept[one].test}")
    changed = [one for one, outcome in now.items() if outcome.outcome == CHANGED]
    print(*(f"changed: {_described(one)}" for one in changed), sep="\n")
    return 1 if lost else 0


def _described(mutant: Mutant) -> str:
    return f"{mutant.house}: {mutant.function}, {mutant.operator} {mutant.place}: {mutant.change}"


def _keep(_: argparse.Namespace) -> int:
    now = read(OUTCOMES)
    write(KEPT, ((one, now.get(one, before)) for one, before in read(KEPT).items()))
    return 0


def _tell(outcomes: Mapping[Mutant, Outcome]) -> None:
    for house in HOUSES:
        counts = Counter(one.outcome for mutant, one in outcomes.items() if mutant.house == house)
        print(f"{house}: " + ", ".join(f"{count} {outcome}" for outcome, count in sorted(counts.items())))
    seconds = [one.seconds for one in outcomes.values() if one.seconds]
    print(f"{sum(seconds) / max(len(seconds), 1):.1f} s per mutant")


if __name__ == "__main__":
    sys.exit(main())
