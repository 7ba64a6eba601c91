"""The daemon on which the machine and its clients fail."""

import os
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from . import clients, files, limits, machine
from .finding import Finding
from .judging import problems_of
from .machine import Machine
from .scenario import Scenario
from .suffering import Suffered, suffer_all

FAULTS: Mapping[str, Callable[[Machine], Finding]] = {
    **machine.FAULTS,
    **files.FAULTS,
    **clients.FAULTS,
    **limits.FAULTS,
}
TURNS = 2
PRESSURE = Path("/proc/pressure/cpu")
NOTABLE_SHARE = 0.03
"""Of the time. All scenarios at once make programs wait for about twice that on two processors, which is
enough to lose a field."""


def play_all(scenarios: Sequence[Scenario], folder: Path) -> dict[str, Suffered]:
    """What became of every scenario, by name.

    A computer that has more to do than it can loses fields by itself: what is not as wanted there is played
    again, with little beside it.
    """
    shortage = Shortage()
    suffered = suffer_all(scenarios, folder / "first")
    for turn in range(TURNS):
        again = [one for one in scenarios if problems_of(one, suffered[one.name])]
        if not again or not shortage.was_there:
            break
        shortage = Shortage()
        suffered |= suffer_all(again, folder / f"again-{turn}", daemons=1, side_by_side=2)
    return suffered


class Shortage:
    """Shortage of processors, from when this is made on."""

    def __init__(self) -> None:
        self._begin_s, self._waited_s = time.monotonic(), _waited_s()

    @property
    def was_there(self) -> bool:
        """Whether programs waited for a processor a notable part of the time, by the kernel's account.

        Without one, by its load, which follows within a minute.
        """
        if self._waited_s is None:
            return os.getloadavg()[0] > (os.cpu_count() or 1)
        waited_s = (_waited_s() or 0.0) - self._waited_s
        return waited_s > NOTABLE_SHARE * (time.monotonic() - self._begin_s)


def _waited_s() -> float | None:
    """For how long some program has waited for a processor since the computer was started."""
    with suppress(OSError):
        return int(PRESSURE.read_text().split("total=")[1].split()[0]) / 1e6
    return None


def play(fault: str, on: Machine) -> Finding:
    """What comes of a fault of the machine or of clients, on a busy computer at the second try."""
    shortage = Shortage()
    first = _play(fault, on)
    if not first.problems or not shortage.was_there:
        return first
    second = _play(fault, on)
    return (
        second._replace(problems=(*second.problems, *(f"at the first try: {one}" for one in first.problems)))
        if second.problems
        else second
    )


def _play(fault: str, on: Machine) -> Finding:
    """That it could not be played to its end is a finding, too."""
    try:
        on.end_captures()
        return FAULTS[fault](on)
    except (AssertionError, OSError) as error:
        return Finding("", None, None, (f"{type(error).__name__}: {error}",))
