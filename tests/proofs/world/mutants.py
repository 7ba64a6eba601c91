"""`python -m tests.proofs.world.mutants [--count N] [--write FILE]`: which mutants do worlds notice?

A mutant is one change in one function of the parts that keep fields, files, jobs and states, drawn by the
seed and put into the running program. It plays the worlds in which its function is called, one after the
other, until one has a lie, fails, or does not end.
"""

import argparse
import ast
import os
import random
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from importlib import import_module
from itertools import chain, islice
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any, NamedTuple

from tests.proofs.mutants.functions import digest, functions
from tests.proofs.mutants.mutant import Mutant
from tests.proofs.mutants.mutated import mutated_tree
from tests.proofs.mutants.operators import RETURNS_NOTHING, changes

from .__main__ import in_memory, preload

NUMBERING = "grabberd.instrument.acquisition.numbering"
PARTS = {
    "ledger": ("grabberd.core.ledger",),
    "ring": ("grabberd.instrument.acquisition.ring",),
    "numbering": (f"{NUMBERING}.field_numbering", f"{NUMBERING}.pending", f"{NUMBERING}.arrivals"),
    "recorder": ("grabberd.instrument.capture.recorder", "grabberd.instrument.capture.recording"),
    "writer": ("grabberd.archive.capture.writer",),
    "seal": ("grabberd.instrument.capture_end", "grabberd.archive.capture.crash_recovery"),
    "queue": ("grabberd.work.job_queue", "grabberd.work.job_runner", "grabberd.archive.state.job_store"),
    "state": ("grabberd.archive.state.state_database", "grabberd.archive.state.state_keeper"),
}
"""Modules whose functions are changed."""
World = tuple[int, tuple[str, ...]]
WORLDS: tuple[World, ...] = (
    (15, ("killed", "killed in a commit", "threads starved", "fields lost on the bus", "restarted")),
    (6, ("disk full", "power cut in a commit", "threads starved", "stall", "disk fails to write")),
)
"""Seeds and faults: many at once, since a world is dear. One that has a lie without a mutant is left out."""
PATIENCE = 5.0
"""A mutant has not ended if it takes so many times the processor time that the world takes without it; of
real time, which others share, ten times as much."""
EQUIVALENT: dict[str, str] = {}
"""Mutants that nobody could notice, by function and change, with the reason."""
HEAD = """# Mutants that worlds notice

Made by `python -m tests.proofs.world.mutants --count {count} --seed {seed} --write …`; do not edit.
A mutant is one change in one function of the parts that keep fields, files, jobs and states, the parts in
turn. Each plays up to {worlds} [worlds](worlds.md) in which its function is called, until one has a lie,
fails, or does not end. **{noticed} of {able} are noticed, {share:.0f} %; {called:.0f} % of those in functions
that these worlds call.** That took {minutes:.0f} minutes of one processor. {equivalent} more change nothing
that anybody could see, and are not counted.

| part | mutants | noticed | not noticed | in no world | equivalent |
|---|---|---|---|---|---|
"""


class Place(NamedTuple):
    """A mutant, and where it is put."""

    part: str
    module: str
    mutant: Mutant

    @property
    def function(self) -> tuple[str, str]:
        """Module and name of the function."""
        return self.module, self.mutant.function

    def __str__(self) -> str:
        return f"{self.mutant.function}: {self.mutant.change}"


class Fate(NamedTuple):
    """What became of a mutant: what noticed it, in how many worlds, and the processor time."""

    place: Place
    lie: str | None
    worlds: int
    seconds: float

    @property
    def is_equivalent(self) -> bool:
        """True for one that was not noticed, since there is nothing to notice."""
        return self.lie is None and str(self.place) in EQUIVALENT


class Unchanged(NamedTuple):
    """A world without a mutant: its lies, the functions that it calls, and its processor time."""

    world: World
    lies: tuple[str, ...]
    called: frozenset[tuple[str, str]]
    seconds: float


def main() -> int:
    """Prints each mutant with what noticed it, and the share."""
    parser = argparse.ArgumentParser(description="Which mutants do worlds notice?")
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    parser.add_argument("--minutes", type=float, default=60.0, help="begin no mutant after that")
    parser.add_argument("--of", help="only mutants whose function and change contain this")
    parser.add_argument("--write", type=Path, help="the page of the documentation")
    given = parser.parse_args()
    preload("tests.proofs.world.mutants")
    from . import world  # noqa: F401, PLC0415 - before the processes fork

    places = [one for one in islice(_drawn(given.seed), given.count) if (given.of or "") in str(one)]
    with in_memory(), ThreadPoolExecutor(given.processes) as pool:
        unchanged = [one for one in pool.map(_unchanged, WORLDS) if _tells_no_lies(one)]
        until_s = time.monotonic() + given.minutes * 60
        found = pool.map(partial(_fate, unchanged, until_s), places)
        fates = [one for one in found if one is not None]
    page = _page(fates, len(unchanged), given.seed)
    given.write.write_text(page, encoding="utf-8") if given.write else print(page)
    return len(unchanged) < len(WORLDS)


def _tells_no_lies(one: Unchanged) -> bool:
    for lie in one.lies:
        print(f"without a mutant, seed {one.world[0]}: {lie}")
    return not one.lies


def _drawn(seed: int) -> Iterator[Place]:
    """Mutants of functions that can be exchanged while the program runs, the parts in turn; none twice."""
    draw = random.Random(seed)
    parts = [list(_places(part)) for part in PARTS]
    for one in parts:
        draw.shuffle(one)
    return chain.from_iterable(zip(*parts, strict=False))


def _places(part: str) -> Iterator[Place]:
    for module in PARTS[part]:
        for one in functions(module, ast.parse(_source(module))):
            if _can_be_exchanged(one.name):
                yield from (
                    Place(part, module, Mutant("", one.name, digest(one.node), *change))
                    for each in changes(one.node)
                    if (change := (each.operator, each.place, each.text))[0] != RETURNS_NOTHING
                )


def _source(module: str) -> str:
    return Path(import_module(module).__file__ or "").read_text(encoding="utf-8")


def _fate(unchanged: Sequence[Unchanged], until_s: float, place: Place) -> Fate | None:
    """None if there was no time left to begin."""
    if time.monotonic() > until_s:
        return None
    lie, seconds, worlds = None, 0.0, 0
    for one in unchanged:
        if lie is None and place.function in one.called:
            lies, took_s = _forked(partial(_lies_of, place, one.world), one.seconds * PATIENCE)
            lie, seconds, worlds = lies[0] if lies else None, seconds + took_s, worlds + 1
    shown = (lie or "not noticed").strip().splitlines()[-1][:160]
    print(f"{place.part}: {place}: {worlds} worlds, {seconds:.1f} s: {shown}", flush=True)
    return Fate(place, lie, worlds, seconds)


def _unchanged(world: World) -> Unchanged:
    (lies, called), took_s = _forked(partial(_calls_of, world), 60.0)
    return Unchanged(world, lies, called, took_s)


def _forked(what: Callable[[], Any], limit_s: float) -> tuple[Any, float]:
    """What a function returns in a process of its own, and its processor time; if it does not, why."""
    context = get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_answer, args=(sender, what, limit_s))
    process.start()
    sender.close()
    try:
        answer = receiver.recv() if receiver.poll(10 * limit_s) else (("it does not end",), limit_s)
    except EOFError:
        answer = ("its process has died",), 0.0
    process.kill()
    process.join()
    return answer


def _answer(sender: Connection, what: Callable[[], Any], limit_s: float) -> None:
    from . import world  # noqa: PLC0415

    world.LONGEST_S = limit_s
    begin_s = time.process_time()
    found = what()
    sender.send((found, time.process_time() - begin_s))


def _lies_of(place: Place, world: World) -> tuple[str, ...]:
    from .world import played  # noqa: PLC0415

    try:
        _exchange(place.module, place.mutant.function, mutated_tree(_source(place.module), place.mutant))
        return played(*world, until_lie=True).lies
    except BaseException as error:
        return (repr(error),)


def _calls_of(world: World) -> tuple[tuple[str, ...], frozenset[tuple[str, str]]]:
    """The lies of a world, and which functions it calls."""
    from .world import played  # noqa: PLC0415

    called: set[tuple[str, str]] = set()
    for module in chain(*PARTS.values()):
        vars(import_module(module))["called_in_world"] = called.add
        tree = ast.parse(_source(module))
        noted = [one for one in functions(module, tree) if _can_be_exchanged(one.name)]
        for one in noted:
            one.node.body[:0] = ast.parse(f"called_in_world(({module!r}, {one.name!r}))").body
        for one in noted:
            _exchange(module, one.name, tree)
    lies = played(*world).lies
    return lies, frozenset(called)


def _can_be_exchanged(function: str) -> bool:
    """False for `__init__` and its like, some of which are made by the interpreter."""
    return not function.rpartition(".")[2].startswith("__")


def _exchange(module: str, function: str, tree: ast.Module) -> None:
    """Gives a function of the running program the code that it has in a changed tree of its module."""
    code = compile(tree, module, "exec", dont_inherit=True)
    found: Any = import_module(module)
    for part in function.split("."):
        found = vars(found)[part]
        code = next(one for one in code.co_consts if isinstance(one, CodeType) and one.co_name == part)
    _function(found).__code__ = code


def _function(found: Any) -> FunctionType:
    for name in ("fget", "__func__", "__wrapped__"):
        if hasattr(found, name):
            return _function(getattr(found, name))
    assert isinstance(found, FunctionType), found
    return found


def _page(fates: Sequence[Fate], worlds: int, seed: int) -> str:
    able = [one for one in fates if not one.is_equivalent]
    noticed = sum(one.lie is not None for one in able)
    head = HEAD.format(
        count=len(fates),
        seed=seed,
        worlds=worlds,
        noticed=noticed,
        able=len(able),
        equivalent=len(fates) - len(able),
        share=100 * noticed / max(len(able), 1),
        called=100 * noticed / max(sum(one.worlds > 0 for one in able), 1),
        minutes=sum(one.seconds for one in fates) / 60,
    )
    rows = (_row(part, [one for one in fates if one.place.part == part]) for part in PARTS)
    return head + "".join(rows) + _survivors(fates)


def _row(part: str, fates: Sequence[Fate]) -> str:
    noticed = sum(one.lie is not None for one in fates)
    equivalent = sum(one.is_equivalent for one in fates)
    called = sum(one.worlds == 0 and not one.is_equivalent for one in fates)
    counts = len(fates), noticed, len(fates) - noticed - equivalent - called, called, equivalent
    return f"| {part} | {' | '.join(map(str, counts))} |\n"


def _survivors(fates: Sequence[Fate]) -> str:
    lines = [
        f"| {one.place.part} | `{str(one.place).replace('|', chr(92) + '|')}` | {_why(one)} |\n"
        for one in fates
        if one.lie is None
    ]
    return "\n| part | not noticed | why |\n|---|---|---|\n" + "".join(lines) if lines else ""


def _why(fate: Fate) -> str:
    if fate.is_equivalent:
        return f"equivalent: {EQUIVALENT[str(fate.place)]}"
    return f"unnoticed in {fate.worlds} worlds" if fate.worlds else "called in no world"


if __name__ == "__main__":
    sys.exit(main())
