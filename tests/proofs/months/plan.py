"""Which fault comes when, by lot: a list that a seed gives again."""

from collections.abc import Mapping, Sequence
from random import Random
from typing import Generic, NamedTuple, TypeVar

from tests.proofs.faults import clients, files, limits, machine
from tests.proofs.faults.playing import FAULTS
from tests.proofs.faults.scenario import Scenario, all_of
from tests.proofs.faults.suffering import Act

T = TypeVar("T")

FIRST_S = 2.0
"""From the cue of a script to its first fault."""
_OWN_DAEMON = (limits.few_descriptors,)
_END_CAPTURES = (
    machine.disk_stalls_briefly,
    machine.disk_stalls_long,
    machine.capture_file_full,
    files.folder_renamed,
    files.descriptors_gone,
    clients.takes_a_file_and_never_reads,
)
"""Or cost fields of every capture there is, or count on being alone."""
(WARMING,) = (name for name, play in FAULTS.items() if play is limits.much_at_once)
"""Comes first in every life: memory that many large answers need is kept for later ones, which is no leak."""
BESIDE = tuple(
    name for name, play in FAULTS.items() if play not in (*_OWN_DAEMON, *_END_CAPTURES, limits.much_at_once)
)
ALONE = tuple(name for name, play in FAULTS.items() if play in _END_CAPTURES)
ENDS = ("killed", "told to end")


class Life(NamedTuple):
    """What one process of the daemon suffers.

    Attributes:
        acts: of the grabber, in one long capture, by their script's times.
        beside: of the machine meanwhile, each after the act of its number; None: nothing.
        alone: of the machine when the long capture has ended.
        end: how the process ends.
    """

    acts: tuple[Act, ...]
    beside: tuple[str | None, ...]
    alone: tuple[str, ...]
    end: str


def lives(seed: int, faults: int, every_s: float, of_a_life: int) -> list[Life]:
    """So many faults by lot, `every_s` after each other, so many of them in a life."""
    random = Random(seed)
    grabber, beside, alone = _Bag(random, playable()), _Bag(random, BESIDE), _Bag(random, ALONE)
    found = []
    for first in range(0, faults, of_a_life):
        count = min(of_a_life, faults - first)
        lonely = max(1, count // 8)
        acts = tuple(
            Act(grabber.draw(), FIRST_S + every_s * number) for number in range(0, count - lonely, 2)
        )
        others = count - lonely - len(acts)
        machines = (WARMING, *(beside.draw() for _ in range(others - 1))) if others else ()
        rest = (None,) * (len(acts) - len(machines))
        found.append(
            Life(acts, (*machines, *rest), tuple(alone.draw() for _ in range(lonely)), random.choice(ENDS))
        )
    return found


def playable() -> Sequence[Scenario]:
    """Scenarios that need nothing of their device but its script, and whose capture goes on."""
    return [
        one
        for one in all_of()
        if not (
            one.options or one.capture or one.calibrated or one.from_start or one.refused or one.own_daemon
        )
        and one.ledger.ended_because is None
        and one.sees.node is None
    ]


class _Bag(Generic[T]):
    """Draws each of some things before any of them comes again."""

    def __init__(self, random: Random, things: Sequence[T]) -> None:
        self._random, self._things = random, things
        self._left: list[T] = []

    def draw(self) -> T:
        """The next one."""
        if not self._left:
            self._left = self._random.sample(self._things, len(self._things))
        return self._left.pop()


def counted(found: Sequence[Life]) -> Mapping[str, int]:
    """How often each fault is played."""
    names = [
        name
        for life in found
        for name in (*(act.scenario.fault for act in life.acts), *life.beside, *life.alone)
    ]
    return {name: names.count(name) for name in names if name is not None}
