"""Content check of a live device's fields: no signal, stale rows, shifted rows. Not meant for recordings.

A field is copied out of the driver's buffer, looked at and packed in one pass over its rows: by the compiled
kernel if the installation has one, else by numpy, which finds the same.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import PAL_HZ, Field, KernelPacking, PackedField, Packing, pack
from grabberd.core.kernel import KERNEL, Kernel
from grabberd.instrument.acquisition.checks.no_picture import KINDS, no_picture
from grabberd.instrument.acquisition.checks.shifted_rows import (
    Profiles,
    Shift,
    find_shift,
    profiles,
    profiles_shape,
)
from grabberd.instrument.acquisition.checks.stale_rows import StaleRows, Words
from grabberd.instrument.acquisition.device import GrabbedField

REPEATED = "repeated"

_WORD = 8
_NOTHING: Words = np.empty(0, np.uint64)
_REFERENCE_NS = 70_000_000
"""Greatest age of the field that rows are compared with, unless the one before is older: by then the
scene has moved on."""
_STAYS_S = 0.5
"""Time for which fields have the same shift after which the scene has changed, not the rows."""
_BACK_COLUMNS, _BACK_ROWS = 2, 12
"""Columns and rows by which a shift back may differ from the shift that it ends."""
_FOR_A_WHILE_S = 0.1
"""Time without a picture before the stream counts as having no signal."""
_NEXT = 1.5
"""Periods after which a field is no longer the next one."""


class Content(NamedTuple):
    """Findings about one field.

    Attributes:
        no_picture: Picture that the grabber substitutes, e.g. "no signal: a flat picture"; None for a real
            one.
        damage: E.g. "repeated", "stale from line 290" or "shifted by -40 px from line 290" (columns count to
            the right, lines are frame lines); None if nothing is wrong.
    """

    no_picture: str | None = None
    damage: str | None = None


class _Copy(NamedTuple):
    """Private copy of a field, since the driver takes its buffer back."""

    words: Words
    rows: NDArray[np.uint8]
    profiles: Profiles
    time_ns: int


class _Look(NamedTuple):
    """Result of one pass over a field's rows."""

    made_up: str | None
    stale: tuple[int, int] | None
    packed: PackedField


class ContentCheck:
    """Checks every field of a stream as it arrives, keeping a copy of the last good one of each parity.

    Args:
        kernel: The compiled kernel, or None for numpy.
        rate_hz: Fields per second.

    Attributes:
        no_picture: Picture that the grabber has substituted for a tenth of a second and still does, or None.
    """

    def __init__(self, kernel: Kernel | None = KERNEL, rate_hz: float = PAL_HZ) -> None:
        self.no_picture: str | None = None
        self._recent_ns = max(_REFERENCE_NS, _NEXT * 1e9 / rate_hz)
        self._stays, self._for_a_while = (
            max(round(seconds * rate_hz), 1) for seconds in (_STAYS_S, _FOR_A_WHILE_S)
        )
        self._kernel = kernel
        self._made_up = 0
        self._start((0, 0))

    def take(self, grabbed: GrabbedField, packing: Packing) -> tuple[Content, PackedField]:
        """Check and pack one field; the packed one shares no memory with it."""
        field = grabbed.field
        if field.luma.shape != self._shape:
            self._start((field.rows, field.columns))
        copy = self._new_copy(grabbed.time_ns)
        look = (
            self._look_by_numpy(field, copy, packing)
            if self._kernel is None
            else self._look_by_kernel(self._kernel, field, copy, packing)
        )
        self._count(look.made_up)
        content = (
            Content(look.made_up) if look.made_up else Content(damage=self._damage(copy, look.stale, field))
        )
        self._remember(copy, field.parity, content)
        return content, look.packed

    def _look_by_kernel(self, kernel: Kernel, field: Field, copy: _Copy, packing: Packing) -> _Look:
        asked, stale = KernelPacking.of(field, packing), self._stale
        good = self._good.get(field.parity)
        words = _NOTHING if good is None else good.words
        made_up, first, last = kernel.take(
            field.luma,
            asked.how,
            asked.by_pixel,
            asked.packed.data,
            copy.words,
            words,
            stale.memory,
            stale.place,
            copy.profiles,
        )
        return _Look(KINDS[made_up], (first, last) if first >= 0 else None, asked.packed)

    def _look_by_numpy(self, field: Field, copy: _Copy, packing: Packing) -> _Look:
        copy.rows[:] = field.luma
        profiles(copy.rows, copy.profiles)
        self._stale.hash(copy.words)
        if (good := self._good.get(field.parity)) is not None:
            self._stale.compare(copy.words, good.words)
        made_up = no_picture(copy.rows, self._stale.hashes)
        stale = None if made_up else self._stale.find(copy.words)
        return _Look(made_up, stale, pack(replace(field, luma=copy.rows), packing, None))

    def _count(self, made_up: str | None) -> None:
        self._made_up = self._made_up + 1 if made_up else 0
        self.no_picture = made_up if self._made_up >= self._for_a_while else None

    def _start(self, shape: tuple[int, int]) -> None:
        self._shape = shape
        words = -(-shape[1] // _WORD)
        self._spare: list[_Copy] = []
        self._stale = StaleRows(shape[0], words)
        self._good: dict[int, _Copy] = {}
        self._before: _Copy | None = None
        self._newest_good: _Copy | None = None
        self._shift: Shift | None = None
        self._shifted = 0

    def _new_copy(self, time_ns: int) -> _Copy:
        rows, columns = self._shape
        if self._spare:
            return self._spare.pop()._replace(time_ns=time_ns)
        words = np.zeros((rows, -(-columns // _WORD)), np.uint64)
        means = np.zeros(profiles_shape(rows, columns), np.int16)
        return _Copy(words, words.view(np.uint8)[:, :columns], means, time_ns)

    def _damage(self, copy: _Copy, stale: tuple[int, int] | None, field: Field) -> str | None:
        self._stale.remember()
        if stale == (0, field.rows - 1):
            return REPEATED
        shift = self._shift_of(copy)
        found = []
        if shift:
            found.append(f"shifted by {shift.columns} px from line {_line(field, shift.row)}")
        if stale:
            end = "" if stale[1] == field.rows - 1 else f" to line {_line(field, stale[1])}"
            found.append(f"stale from line {_line(field, stale[0])}{end}")
        return ", ".join(found) or None

    def _shift_of(self, copy: _Copy) -> Shift | None:
        """Shift of a field's rows.

        A field is compared with the one before, whatever was wrong with that: one that is like a shifted
        field is shifted, and one that is shifted back is good again. So no field is ever taken for the
        measure of its neighbours that is shifted itself.
        """
        held, self._shift = self._shift, None
        relative = self._shift_to(self._before, copy)
        shift = relative
        if held is not None and self._is_recent(self._before, copy):
            like_a_good_one = self._is_recent(self._newest_good, copy)
            same = self._shift_to(self._newest_good, copy) if like_a_good_one else held
            shift = same if relative is None else None if _ends(relative, held) else relative
        self._shifted = self._shifted + 1 if shift else 0
        self._shift = None if self._shifted > self._stays else shift
        return self._shift

    def _is_recent(self, reference: _Copy | None, copy: _Copy) -> bool:
        return reference is not None and 0 <= copy.time_ns - reference.time_ns <= self._recent_ns

    def _shift_to(self, reference: _Copy | None, copy: _Copy) -> Shift | None:
        if reference is None or not self._is_recent(reference, copy):
            return None
        return find_shift(copy.rows, reference.rows, copy.profiles, reference.profiles, self._kernel)

    def _remember(self, copy: _Copy, parity: int, content: Content) -> None:
        """Keep the last field, and the last good one of each parity; buffers of others are used again."""
        if content.no_picture or content.damage == REPEATED:
            self._spare.append(copy)
            return
        before, self._before = self._before, copy
        if before is not None and all(before is not good for good in self._good.values()):
            self._spare.append(before)
        if content.damage:
            return
        replaced = self._good.get(parity)
        self._good[parity] = self._newest_good = copy
        if replaced is not None:
            self._stale.learn()
            self._spare.append(replaced)


def _ends(back: Shift, shift: Shift) -> bool:
    """True if a shift is the other one undone."""
    columns, rows = abs(back.columns + shift.columns), abs(back.row - shift.row)
    return columns <= _BACK_COLUMNS and rows <= _BACK_ROWS


def _line(field: Field, row: int) -> int:
    return field.y0 + row * field.y_step
