"""Whether what a capture says of its fields is true, by rules that stand in the head of the page."""

import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import NamedTuple

from grabberd.core.ledger import (
    UNCERTAIN,
    LedgerEvent,
    LossCause,
    Outcome,
    Rebase,
    Slot,
    cause_of_loss,
    too_high_by,
    unsure_by,
)

from .grabber import Handed
from .simulation import Simulation
from .weather import Case, drawn

_UNCERTAIN = re.compile(UNCERTAIN + r" (\d+)")
_MS = re.compile(r"(-?\d+(?:\.\d+)?) (ms|s|h)\b")
_STALL_S = 0.7
_NOTICED_S = 1.4
"""Only its length tells losses on the bus from a grabber that has stopped, or from a camera that is away for
less than the time in which it is asked for."""
_SILENT = {LossCause.DEVICE, LossCause.CAMERA}
_NEEDS = {
    Rebase.COUNT: ("recounts", "turns", "twice", "swapped", "zeros", "backs", "late", "steps"),
    Rebase.PHASE: ("turns", "suspends", "twice", "swapped"),
    Rebase.CLOCK: ("steps", "suspends", "zeros", "backs", "late"),
}
"""Weather without which an event of a kind is false."""


class Verdict(NamedTuple):
    """A run and what came of its audit.

    Attributes:
        case: Its weather.
        fields: Number of fields in its account; `camera_s`: time of the camera that the run took.
        complete: True if the account says that nothing is missing.
        uncertain: Fields whose number it says is uncertain; `needless`: those of them for no reason.
        lies: What is false, a sentence for each kind.
    """

    case: Case
    fields: int
    camera_s: float
    complete: bool
    uncertain: int
    needless: int
    lies: tuple[str, ...]


def judged(seed: int) -> Verdict:
    """Runs the case of a seed, and judges what it says."""
    return judged_case(drawn(seed))


def judged_case(case: Case) -> Verdict:
    """Runs a case, and judges what it says."""
    run = Simulation(case)
    run.run()
    camera_s = (run.clock.ns - run.begin_ns) / 1e9
    if run.recorder is None or run.recorder.first_n is None:
        return Verdict(case, 0, camera_s, False, 0, 0, ())
    account = Account(run)
    doubtful = sum(one.stated > 0 for one in account.fields)
    needless = doubtful if case.weather.clear else 0
    lies, ledger = tuple(_of_each_kind(account.lies())), account.ledger
    return Verdict(case, ledger.total, camera_s, ledger.complete, doubtful, needless, lies)


def _of_each_kind(lies: Iterator[tuple[str, str]]) -> Iterator[str]:
    first: dict[str, str] = {}
    count = Counter[str]()
    for kind, lie in lies:
        first.setdefault(kind, lie)
        count[kind] += 1
    for kind, lie in first.items():
        yield f"{kind}: {lie}" + (f", and {count[kind] - 1} more" if count[kind] > 1 else "")


class Entered(NamedTuple):
    """A field as the capture has it, and as it is.

    Attributes:
        slot: What the capture has; `handed`: what the program was given.
        after: The camera's last field that the program was given before.
        stated: By how many its number is said to be uncertain; 0 if it is certain.
    """

    slot: Slot
    handed: Handed
    after: int
    stated: int


class Account:
    """What a capture says, beside what is true.

    Attributes:
        fields: All that came, in order; `events` and `ledger`: what is said beside.
    """

    def __init__(self, run: Simulation) -> None:
        recorder = run.recorder
        assert recorder is not None
        assert recorder.first_n is not None, "no field came"
        self._run, self.ledger = run, recorder.ledger
        self._period_ns, self._grid_ns = run.case.weather.period_ns, run.case.weather.grid_ms * 1e6
        self.events = recorder.ledger.events
        matched = _matched(run.slots, run.arrived_ns, run.grabber.handed)
        handed = {slot.n - recorder.first_n: one for slot, one in matched}
        self.fields = list(self._entered(run.recorded, handed))

    def _entered(self, slots: Sequence[Slot], handed: dict[int, Handed]) -> Iterator[Entered]:
        after = -1
        first = slots[0].n if slots else 0
        for n, one in sorted(handed.items()):
            if n < first and one.k is not None:
                after = max(after, one.k)
        for slot in slots:
            found = _UNCERTAIN.search(slot.reason or "")
            one = handed[slot.n]
            yield Entered(slot, one, after, int(found[1]) if found else 0)
            after = after if one.k is None else one.k

    def lies(self) -> Iterator[tuple[str, str]]:
        """Kind and sentence of everything that is false."""
        for one in self.fields:
            yield from self._of_its_picture(one)
            yield from self._of_its_number(one)
            yield from self._of_its_time(one)
        for index, one in enumerate(self.fields):
            yield from self._of_its_losses(index, one)
        for event in self.events:
            yield from self._of_an_event(event)
        yield from self._of_the_end()

    def _of_its_picture(self, one: Entered) -> Iterator[tuple[str, str]]:
        slot, handed = one.slot, one.handed
        shown = _shown(slot)
        if shown != handed.shown:
            yield "picture", f"field {slot.n} has the picture {shown}, the driver gave {handed.shown}"
        is_whole = handed.k == shown and not handed.flagged
        if slot.outcome is Outcome.RECEIVED and not is_whole:
            yield "picture", f"field {slot.n} passes for intact"
        if slot.outcome is Outcome.DAMAGED and is_whole and not one.stated:
            yield "picture", f"field {slot.n} passes for damaged ({slot.reason})"

    def _off(self, n: int, k: int) -> int:
        """Fields by which a number is too high, beyond what events say of it."""
        return n + self._first_k - k - sum(too_high_by(event) for event in self.events if event.n <= n)

    @cached_property
    def _asked_k(self) -> int:
        """The camera's field that the capture was to begin with."""
        run = self._run
        if not run.begins_with_the_ring:
            return self._k_from(run.start_ns)
        oldest_ns = self._middle_ns(run.grabber.handed[0].k or 0)
        return self._k_from(max(run.start_ns - run.case.pre_fields * self._period_ns, oldest_ns))

    @cached_property
    def _first_k(self) -> int:
        """The camera's field with number 0: the first certain number says which, if that may be."""
        self.__dict__["_first_k"] = 0
        certain = (one for one in self.fields if not one.stated and one.handed.k is not None)
        said = next((-self._off(one.slot.n, one.handed.k or 0) for one in certain), self._asked_k)
        return said if abs(said - self._asked_k) <= self._at_an_edge else self._asked_k

    @property
    def _at_an_edge(self) -> int:
        """Fields by which begin and end may be off together with the times that they go by."""
        return 1 + math.ceil(self._grid_ns / self._period_ns)

    def _k_from(self, time_ns: float) -> int:
        k = max(round((time_ns - self._run.begin_ns) / self._period_ns), 0)
        while self._middle_ns(k) < time_ns:
            k += 1
        while k and self._middle_ns(k - 1) >= time_ns:
            k -= 1
        return k

    def _middle_ns(self, k: int) -> int:
        return self._run.grabber.camera.middle_ns(k)

    def _of_its_number(self, one: Entered) -> Iterator[tuple[str, str]]:
        slot, k = one.slot, one.handed.k
        unsure = one.stated + sum(unsure_by(event) for event in self.events if event.n <= slot.n)
        if k is not None and abs(off := self._off(slot.n, k)) > unsure:
            said = f"uncertain by up to {one.stated}" if one.stated else "certain"
            yield "number", f"field {slot.n}, said to be {said}, is {off:+d} off (the camera's {k})"

    def _of_its_time(self, one: Entered) -> Iterator[tuple[str, str]]:
        slot, k = one.slot, one.handed.k
        if k is None:
            return
        late_ns = slot.time_ns - self._middle_ns(k)
        begins = [event.reason for event in self.events if event.kind is Rebase.BEGIN and event.n > slot.n]
        bound_ns = self._period_ns * (1 + one.stated) + self._grid_ns + sum(map(_said_ns, begins))
        if abs(late_ns) > bound_ns:
            late = f"{late_ns / self._period_ns:+.2f} periods later than it was"
            yield "time", f"field {slot.n} is said to be {late} ({slot.reason})"

    def _of_its_losses(self, index: int, one: Entered) -> Iterator[tuple[str, str]]:
        if not one.slot.lost_before or one.handed.k is None:
            return
        first = last = index
        while first and (self.fields[first].stated or self.fields[first - 1].stated):
            first -= 1
        while last + 1 < len(self.fields) and self.fields[last].stated:
            last += 1
        end_k = max(self.fields[last].handed.k or 0, one.handed.k)
        true = self._run.grabber.driver.losses(self.fields[first].after + 1, end_k)
        if one.stated and not true:
            return  # a doubt also says that there may be none
        possible = {LossCause.UNKNOWN, *(cause for causes in true for cause in causes)}
        lasted_s = sum(true.values()) * self._period_ns / 1e9
        possible |= {LossCause.DEVICE} if lasted_s > _STALL_S else set()
        possible |= {LossCause.CABLE} if lasted_s < _NOTICED_S and possible & _SILENT else set()
        for entry in one.slot.lost_before:
            cause = cause_of_loss(entry.outcome, entry.reason)
            if cause not in possible:
                was = ", ".join(f"{count} by {'/'.join(causes)}" for causes, count in true.items())
                said = f"{entry.count} before field {one.slot.n} lost to '{entry.reason}'"
                yield "cause", f"{said}; truly {was or 'none'}"

    def _of_an_event(self, event: LedgerEvent) -> Iterator[tuple[str, str]]:
        weather = self._run.case.weather
        if event.kind in _NEEDS and not any(getattr(weather, name) for name in _NEEDS[event.kind]):
            yield "event", f"'{event.reason}' at field {event.n}, which is not so"

    def _of_the_end(self) -> Iterator[tuple[str, str]]:
        """The account goes on to the end that was asked for: by its own numbers if that was a length."""
        if not self.fields or self.fields[-1].stated:
            return  # what is uncertain to the end leaves open how many fields there were
        end_n, length = self.ledger.end_n or 0, self._run.case.fields
        stopped = self._k_from(self._run.stop_ns) - self._first_k if self._run.stop_ns else None
        off = sum(map(too_high_by, self.events))
        if end_n != length and (stopped is None or abs(end_n - off - stopped) > self._at_an_edge):
            yield "end", f"the account has {end_n} fields; asked for were {length}, until the stop {stopped}"


def _shown(slot: Slot) -> int:
    assert slot.numbered is not None
    return int(slot.numbered.packed.data[0, 0, :8].view("int64")[0])


def _matched(
    slots: Sequence[Slot], arrived_ns: Sequence[int], handed: Sequence[Handed]
) -> Iterator[tuple[Slot, Handed]]:
    """Each slot with what was handed over for it; a buffer that is handed over again may have none."""
    rest = iter(handed)  # the last may have no number yet
    for slot, came_ns in zip(slots, arrived_ns, strict=True):
        yield slot, next(one for one in rest if one.at_ns == came_ns)


def _said_ns(reason: str) -> float:
    found = _MS.search(reason)
    return 0.0 if found is None else float(found[1]) * {"ms": 1e6, "s": 1e9, "h": 3.6e12}[found[2]]
