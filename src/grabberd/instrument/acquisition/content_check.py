"""Content check of a live device's fields: grabbers deliver most damage without any error flag.

It detects pictures drawn by the chip when no camera is connected, rows left over from an earlier field, and
rows shifted sideways (`shifted_rows`). A field is copied out of the driver's buffer, checked and packed in
one pass over its rows: by the compiled kernel if installed, else by numpy, with the same results. Recordings
are not checked: their fields may legitimately repeat. A dark camera's noise has less contrast than snow and
counts as a picture; a repeated row is stale only where it has enough noise for a match to be significant,
which is learned from the stream.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import PAL_HZ, Field, KernelPacking, PackedField, Packing, pack
from grabberd.core.kernel import KERNEL, Kernel
from grabberd.instrument.acquisition.device import GrabbedField
from grabberd.instrument.acquisition.shifted_rows import Profiles, Shift, find_shift, profiles, profiles_shape

FLAT = "no signal: a flat picture"
BARS = "no signal: bars"
SNOW = "no signal: snow"
KINDS = (None, FLAT, BARS, SNOW)
"""Indexed by the kernel's result."""
_EDGE_ROWS = 4
"""Rows at the top and bottom that a chip may blank."""
_SNOW_SIGMA = 25
"""Grey values; a dark camera stays well below."""
_SNOW_CORRELATION = 0.1
_SNOW_EVERY_ROW = _FEW = 16
"""Sampling of rows: a sixteenth of the picture suffices, so that a normal field costs almost nothing."""


def no_picture(rows: NDArray[np.uint8], hashes: NDArray[np.uint64]) -> str | None:
    """Return `FLAT`, `BARS` or `SNOW`, or None for a real picture.

    Args:
        rows: (rows, columns) grey values of one field.
        hashes: (rows,) numbers that are equal where rows are equal.
    """
    return _drawn(rows, hashes) or _snow(rows)


def _drawn(rows: NDArray[np.uint8], hashes: NDArray[np.uint64]) -> str | None:
    if len(rows) <= 2 * _EDGE_ROWS:
        return None
    inner, hashes = rows[_EDGE_ROWS:-_EDGE_ROWS], hashes[_EDGE_ROWS:-_EDGE_ROWS]
    if (hashes == hashes[0]).all():
        return FLAT if _is_even(inner[:1]) else BARS
    return BARS if _is_even(inner[::_FEW]) and _is_even(inner) else None


def _is_even(rows: NDArray[np.uint8]) -> bool:
    """True if every row has a single grey value."""
    return bool((rows == rows[:, :1]).all())


def _snow(rows: NDArray[np.uint8]) -> str | None:
    """Detect strong contrast that is uncorrelated from row to row."""
    lower = rows[_SNOW_EVERY_ROW::_SNOW_EVERY_ROW].ravel().astype(np.float64)
    count, total = len(lower), int(lower.sum())
    # Integers, so that the order of summation does not matter.
    variance = count * int(lower @ lower) - total**2
    if not count or variance < (_SNOW_SIGMA * count) ** 2:
        return None
    upper = rows[_SNOW_EVERY_ROW - 1 : -1 : _SNOW_EVERY_ROW].ravel().astype(np.float64)
    upper_total = int(upper.sum())
    upper_variance = count * int(upper @ upper) - upper_total**2
    covariance = count * int(upper @ lower) - upper_total * total
    return (
        SNOW if covariance < _SNOW_CORRELATION * math.sqrt(float(variance) * float(upper_variance)) else None
    )


REMEMBERED = 64
"""Fields: with 32 buffers, a driver may deliver data received up to 32 frames ago."""
_LEARNED = 8
"""Field pairs over which the least difference is taken, so that a single lively pair is not enough."""
_EVIDENCE = 40
"""Pixel groups that should have differed: by chance all are equal less than once in e⁴⁰ fields."""

Words = NDArray[np.uint64]


class StaleRows:
    """Memory of a stream's rows, searched for repetitions.

    Args:
        rows: Number of rows of a field.
        words: Number of groups of eight pixels in a row.

    Attributes:
        memory: Everything below in one array, as expected by the kernel.
        hashes: (rows,) numbers of the newest field's rows; equal rows have equal numbers.
        differing: (rows,) number of words in which it differs from the last good field of its parity.
    """

    def __init__(self, rows: int, words: int) -> None:
        # Odd weights have an inverse modulo 2**64: a change in a single word always changes the sum.
        random = np.random.default_rng(words)
        weights: Words = random.integers(0, 2**63, words, np.uint64) * np.uint64(2) + np.uint64(1)
        kept = REMEMBERED + _LEARNED + 2
        self.memory: Words = np.zeros(words + kept * rows, np.uint64)
        self.memory[:words] = weights
        by_row = self.memory[words:].reshape(kept, rows)
        self._weights = self.memory[:words]
        self._seen = by_row[:REMEMBERED]
        self._learned = by_row[REMEMBERED:-2].view(np.int64)
        self.hashes = by_row[-2]
        self.differing = by_row[-1].view(np.int64)
        self._fields = self._lessons = 0

    @property
    def place(self) -> int:
        """Index of the next field in the memory."""
        return self._fields % REMEMBERED

    def hash(self, words: Words) -> None:
        """Hash each of a field's rows (rows, words)."""
        np.einsum("ij,j", words, self._weights, out=self.hashes)

    def compare(self, words: Words, good: Words) -> None:
        """Compare a field with the last good one of its parity."""
        self.differing[:] = (words != good).sum(axis=1)

    def find(self, words: Words) -> tuple[int, int] | None:
        """Find the first and last stale row of the hashed field, or None, and write it into the memory.

        Rows without contrast at the ends of a stale run are not counted. A completely stale field is detected
        from the first field on, a partly stale one only once it is known how much fields differ.
        """
        old = (self._seen == self.hashes).any(axis=0)
        self._seen[self.place] = self.hashes
        return _found(old, _contrast(words), self._learned.min(axis=0)) if old.any() else None

    def remember(self) -> None:
        """Keep the field that was just written into the memory."""
        self._fields += 1

    def learn(self) -> None:
        """Learn by how much a good field differs from the previous good one of its parity."""
        self._learned[self._lessons % _LEARNED] = self.differing
        self._lessons += 1


def _found(
    old: NDArray[np.bool_], contrast: NDArray[np.int64], differing: NDArray[np.int64]
) -> tuple[int, int] | None:
    if contrast.sum() >= _EVIDENCE and old[contrast > 0].all():
        return 0, len(old) - 1
    evidence = np.where(old, np.minimum(contrast, differing), 0)
    starts, ends = _runs(old)
    total = np.concatenate(([0], np.cumsum(evidence)))
    for start, end in zip(starts, ends, strict=True):
        if total[end] - total[start] >= _EVIDENCE:
            telling = start + np.flatnonzero(evidence[start:end])
            return int(telling[0]), int(telling[-1]) if end < len(old) else len(old) - 1
    return None


def _runs(mask: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Start and end indices (exclusive) of the runs of True."""
    steps = np.diff(np.concatenate(([False], mask, [False])).astype(np.int8))
    return np.flatnonzero(steps == 1), np.flatnonzero(steps == -1)


def _contrast(words: Words) -> NDArray[np.int64]:
    """(rows,) number of groups of eight pixels with more than one grey value."""
    # A word equals itself rotated by a byte only if its eight pixels are equal.
    turned = (words >> np.uint64(8)) | (words << np.uint64(56))
    return (words != turned).sum(axis=1)


REPEATED = "repeated"

_WORD = 8
_NOTHING: Words = np.empty(0, np.uint64)
_REFERENCE_NS = 70_000_000
"""Maximum age of the field that rows are compared with, unless the previous one is older: after that the
scene has changed."""
_STAYS_S = 0.5
"""If fields have the same shift for this time, the scene has changed and the rows are not shifted."""
_BACK_COLUMNS, _BACK_ROWS = 2, 12
"""Columns and rows by which a shift back may differ from the shift that it undoes."""
_FOR_A_WHILE_S = 0.1
"""Time without a picture before the stream counts as having no signal."""
_NEXT = 1.5
"""Periods after which a field is no longer the next one."""


class Content(NamedTuple):
    """Findings about one field.

    Attributes:
        no_picture: Picture substituted by the grabber, e.g. "no signal: a flat picture"; None for a real one.
        damage: E.g. "repeated", "stale from line 290" or "shifted by -40 px from line 290" (columns count to
            the right, lines are frame lines); None if nothing is wrong.
    """

    no_picture: str | None = None
    damage: str | None = None


class _Copy(NamedTuple):
    """Copy of a field, since its buffer is returned to the driver."""

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
        """Check and pack one field; the packed one shares no memory with it.

        One that the driver says is damaged is no reference for others, and not searched for more damage.
        """
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
        content = self._found(copy, look, grabbed)
        self._remember(copy, field.parity, content, is_reference=grabbed.damage is None)
        return content, look.packed

    def _found(self, copy: _Copy, look: _Look, grabbed: GrabbedField) -> Content:
        if look.made_up:
            return Content(look.made_up)
        self._stale.remember()
        if look.stale == (0, grabbed.field.rows - 1):
            return Content(damage=REPEATED)
        return Content(damage=None if grabbed.damage else self._damage(copy, look.stale, grabbed.field))

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

        A field is compared with the previous one even if that is damaged: a field that matches a shifted one
        is shifted as well, and a field that is shifted back is good again. So a shifted field never becomes
        the reference of its neighbours.
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

    def _remember(self, copy: _Copy, parity: int, content: Content, *, is_reference: bool) -> None:
        """Keep the last field, and the last good one of each parity; the buffers of others are reused."""
        if content.no_picture or content.damage == REPEATED or not is_reference:
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
    """True if a shift undoes the other one."""
    columns, rows = abs(back.columns + shift.columns), abs(back.row - shift.row)
    return columns <= _BACK_COLUMNS and rows <= _BACK_ROWS


def _line(field: Field, row: int) -> int:
    return field.y0 + row * field.y_step
