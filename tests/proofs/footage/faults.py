"""Faults of recordings: which of a camera's frames a recorder shows, when, and how they are laid out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

COUNT = 40
"""Frames of a recording."""
PERIOD_MS = 40.0
DROPPED, HELD, FROZEN_AFTER = (20, 21), 3, 30
Picture = NDArray[np.uint8] | NDArray[np.uint16]


class Layout(StrEnum):
    """How the two fields of a frame lie in its picture."""

    TOP_FIRST = "top field first"
    BOTTOM_FIRST = "bottom field first"
    STACKED = "one field above the other"


@dataclass(frozen=True, slots=True)
class Fault:
    """What is wrong with a recording; the defaults are right.

    Attributes:
        name: In a few words.
        told: Words of a remark that explains an error; without any, there must be none.
        kept: True for the frames that are in the recording.
        shows: The camera's frame that stands in the place of another; told which move most.
        at_ms: Time that a frame has in the recording.
        layout, bits, turned, full_range: Of its pictures and their marks.
    """

    name: str
    told: tuple[str, ...] = ()
    kept: Callable[[int], bool] = lambda _: True
    shows: Callable[[int, Sequence[int]], int] = lambda k, _: k
    at_ms: Callable[[int], float] = lambda k: PERIOD_MS * k
    layout: Layout = Layout.TOP_FIRST
    bits: int = 8
    turned: int = 0
    full_range: bool = False

    def __reduce__(self) -> tuple[Callable[[str], "Fault"], tuple[str]]:
        """Goes to another process by its name: functions do not."""
        return named, (self.name,)

    @property
    def needs_times(self) -> bool:
        """True if it is in the times alone."""
        return self.at_ms(1) != PERIOD_MS


NONE = Fault("none")
FAULTS = (
    NONE,
    Fault("two pictures dropped", ("taken for consecutive",), kept=lambda k: k not in DROPPED),
    Fault(
        "three pictures repeated in place of their successors",
        shows=lambda k, lively: k - (k in lively),
    ),
    Fault("every picture twice", shows=lambda k, _: k - k % 2),
    Fault("24 pictures made 25", ("repeat the one before",), shows=lambda k, _: k - (k + 1) // 25),
    Fault("a frozen end", shows=lambda k, _: min(k, FROZEN_AFTER)),
    Fault("an even drift of .2 %", at_ms=lambda k: 1.002 * PERIOD_MS * k),
    Fault("jitter of ±4 ms", at_ms=lambda k: PERIOD_MS * k + (4 * np.sin(2.4 * k * k) if k else 0.0)),
    Fault("bottom field first", ("Nothing tells which field",), layout=Layout.BOTTOM_FIRST),
    Fault("one field above the other", ("above the other",), layout=Layout.STACKED),
    Fault("marked as turned by 90°", ("turned by",), turned=90),
    Fault("marked as turned by 180°", ("turned by",), turned=180),
    Fault("10 bits a sample", ("bits",), bits=10),
    Fault("16 bits a sample", ("bits",), bits=16),
    Fault("marked as of full range", ("range",), full_range=True),
)


def named(name: str) -> Fault:
    """The fault of this name."""
    return next(one for one in FAULTS if one.name == name)


MUST_BE_READ = tuple(
    one.name
    for one in FAULTS
    if one.layout is not Layout.STACKED and not (one.turned or one.bits > 8 or one.full_range)
)


class Frame(NamedTuple):
    """A picture of a recording: its place in the camera's sequence, its time in s, and its samples."""

    number: int
    time_s: float
    picture: Picture


def frames(fields: Sequence[NDArray[np.uint8]], fault: Fault) -> list[Frame]:
    """The recording of a camera with this fault.

    Args:
        fields: The camera's fields from a top one on, each (lines, columns); at least 2 · `COUNT` + 1.
        fault: What is wrong with it.
    """
    lively = _lively(fields)
    return [
        Frame(
            k,
            fault.at_ms(k) / 1e3,
            _deep(_laid_out(fields, fault.shows(k, lively), fault.layout), fault.bits),
        )
        for k in range(COUNT)
        if fault.kept(k)
    ]


def _lively(fields: Sequence[NDArray[np.uint8]]) -> list[int]:
    """The frames that differ most from the one before."""
    change = [np.abs(fields[2 * k].astype(int) - fields[2 * k - 2]).mean() for k in range(1, COUNT)]
    return sorted(int(k) + 1 for k in np.argsort(change)[-HELD:])


def _laid_out(fields: Sequence[NDArray[np.uint8]], k: int, layout: Layout) -> NDArray[np.uint8]:
    first = 2 * k + first_n(layout)
    top, bottom = sorted((first, first + 1), key=lambda n: n % 2)
    if layout is Layout.STACKED:
        return np.vstack([fields[top], fields[bottom]])
    return np.stack([fields[top], fields[bottom]], axis=1).reshape(-1, fields[top].shape[1])


def first_n(layout: Layout) -> int:
    """Number of the first field in a recording, counted from the camera's first top one."""
    return 1 if layout is Layout.BOTTOM_FIRST else 0


def _deep(picture: NDArray[np.uint8], bits: int) -> Picture:
    return picture if bits == 8 else (picture.astype(np.uint16) << (bits - 8)).astype(np.uint16)
