"""Content check of a live device's fields: no signal, stale rows, shifted rows. Not meant for recordings."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.acquisition.checks.no_picture import no_picture
from grabberd.acquisition.checks.shifted_rows import Profiles, find_shift, profiles
from grabberd.acquisition.checks.stale_rows import REPEATED, StaleRows, Words
from grabberd.acquisition.device import GrabbedField
from grabberd.field import Field

_WORD = 8
_REFERENCE_NS = 70_000_000
"""Greatest age of the field that rows are compared with: after three field periods the scene has moved on."""
_REFERENCE_USES = 4
"""Comparisons per reference: if it contradicts several fields in a row, the scene has changed, not the
rows."""
_FOR_A_WHILE = 5
"""Fields without a picture (a tenth of a second) before the stream counts as having no signal."""


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


class ContentCheck:
    """Checks every field of a stream as it arrives, keeping a copy of the last good one of each parity.

    Attributes:
        no_picture: Picture that the grabber has substituted for a tenth of a second and still does, or None.
    """

    def __init__(self) -> None:
        self.no_picture: str | None = None
        self._made_up = 0
        self._start((0, 0))

    def look(self, grabbed: GrabbedField) -> Content:
        """Check one field; takes a quarter of a millisecond for 288 rows of 720."""
        field = grabbed.field
        if field.luma.shape != self._shape:
            self._start((field.rows, field.columns))
        buffer = self._spare.pop()
        copy = self._copied(grabbed, buffer)
        hashes = self._stale.hashes(copy.words)
        made_up = no_picture(copy.rows, hashes)
        self._count(made_up)
        content = Content(made_up) if made_up else Content(damage=self._damage(copy, hashes, field))
        good = content == Content()
        self._spare.append(self._keep(copy, field.parity) if good else buffer)
        return content

    def _count(self, made_up: str | None) -> None:
        self._made_up = self._made_up + 1 if made_up else 0
        self.no_picture = made_up if self._made_up >= _FOR_A_WHILE else None

    def _start(self, shape: tuple[int, int]) -> None:
        self._shape = shape
        words = -(-shape[1] // _WORD)
        self._spare = [np.zeros((shape[0], words), np.uint64)]
        self._stale = StaleRows(shape[0], words)
        self._good: dict[int, _Copy] = {}
        self._reference: _Copy | None = None
        self._uses = 0

    def _copied(self, grabbed: GrabbedField, words: Words) -> _Copy:
        rows = words.view(np.uint8)[:, : self._shape[1]]
        rows[:] = grabbed.field.luma
        return _Copy(words, rows, profiles(rows), grabbed.time_ns)

    def _damage(self, copy: _Copy, hashes: Words, field: Field) -> str | None:
        stale = self._stale.find(copy.words, hashes)
        if stale == (0, field.rows - 1):
            return REPEATED
        reference = self._reference_for(copy)
        shift = (
            find_shift(copy.rows, reference.rows, copy.profiles, reference.profiles) if reference else None
        )
        found = []
        if shift:
            found.append(f"shifted by {shift.columns} px from line {_line(field, shift.row)}")
        if stale:
            end = "" if stale[1] == field.rows - 1 else f" to line {_line(field, stale[1])}"
            found.append(f"stale from line {_line(field, stale[0])}{end}")
        return ", ".join(found) or None

    def _reference_for(self, copy: _Copy) -> _Copy | None:
        """The last good field, unless it is too old or has contradicted several fields in a row."""
        self._uses += 1
        reference = self._reference
        if reference is None or self._uses > _REFERENCE_USES:
            return None
        return reference if 0 <= copy.time_ns - reference.time_ns <= _REFERENCE_NS else None

    def _keep(self, copy: _Copy, parity: int) -> Words:
        """Keep a good field; return the buffer of the one it replaces."""
        replaced = self._good.get(parity)
        self._good[parity] = self._reference = copy
        self._uses = 0
        if replaced is None:
            return np.zeros_like(copy.words)
        self._stale.learn(copy.words, replaced.words)
        return replaced.words


def _line(field: Field, row: int) -> int:
    return field.y0 + row * field.y_step
