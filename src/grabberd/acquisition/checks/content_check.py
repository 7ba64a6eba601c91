"""Content check of a live device's fields: no signal, stale rows, shifted rows. Not meant for recordings.

A picture that the grabber's chip draws in place of the camera's has no noise: its rows are identical bit for
bit, or each row has a single grey value. Snow is nothing but noise. A dark camera has noise of its own, with
less contrast than snow, and counts as a picture.

Stale rows are rows of a live field that the device has delivered before. The noise of an analog signal never
repeats: a row identical to an earlier one bit for bit is stale, provided it has enough noise for a match to
mean anything. How much it has is learned from the stream itself, by counting the groups of eight pixels that
differ from one field to the next: clipped black has none.
"""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from grabberd.acquisition.checks.shifted_rows import Profiles, Shift, find_shift, profiles
from grabberd.acquisition.device import GrabbedField
from grabberd.field import Field

REPEATED = "repeated"

_REMEMBERED = 64
"""Fields: with 32 buffers, a driver may hand out what it received up to 32 frames ago."""
_LEARNED = 8
"""Field pairs over which the least difference counts, so that one lively pair proves nothing."""
_EVIDENCE = 40.0
"""Pixel groups that should have differed: by chance all are equal less than once in e⁴⁰ fields."""

Words = NDArray[np.uint64]
FLAT = "no signal: a flat picture"
BARS = "no signal: bars"
SNOW = "no signal: snow"
_EDGE_ROWS = 4
"""Rows at the top and bottom that a chip may blank."""
_SNOW_SIGMA = 25.0
"""Grey values; a dark camera stays well below."""
_SNOW_CORRELATION = 0.1
_SNOW_EVERY_ROW = _FEW = 16
"""Sampling of rows: a sixteenth of the picture decides, so that a normal field costs next to nothing."""
_WORD = 8
_REFERENCE_NS = 70_000_000
"""Greatest age of the field that rows are compared with: after three field periods the scene has moved on."""
_STAYS = 25
"""Fields in a row with the same shift, half a second, after which the scene has changed, not the rows."""
_BACK_COLUMNS, _BACK_ROWS = 2, 12
"""Columns and rows by which a shift back may differ from the shift that it ends."""
_FOR_A_WHILE = 5
"""Fields without a picture (a tenth of a second) before the stream counts as having no signal."""


class StaleRows:
    """Memory of a stream's rows, searched for repetitions.

    Args:
        rows: Number of rows of a field.
        words: Number of groups of eight pixels in a row.
    """

    def __init__(self, rows: int, words: int) -> None:
        # Odd weights have an inverse modulo 2**64: a change in a single word always changes the sum.
        random = np.random.default_rng(words)
        self._weights: Words = random.integers(0, 2**63, words, np.uint64) * np.uint64(2) + np.uint64(1)
        self._seen: Words = np.zeros((_REMEMBERED, rows), np.uint64)
        self._differing: NDArray[np.int64] = np.zeros((_LEARNED, rows), np.int64)
        self._fields = self._lessons = 0

    def hashes(self, words: Words) -> Words:
        """Hash each of the rows (rows, words) to one number, (rows,); equal rows give equal numbers."""
        hashes: Words = np.einsum("ij,j", words, self._weights)
        return hashes

    def find(self, words: Words, hashes: Words) -> tuple[int, int] | None:
        """Find the first and last stale row, or None, and remember the field.

        Rows without contrast at the ends of a stale run are not counted. A wholly stale field is found from
        the first field on, a partly stale one only once it is known how much fields differ.
        """
        old = (self._seen == hashes).any(axis=0)
        self._seen[self._fields % _REMEMBERED] = hashes
        self._fields += 1
        return _found(old, _contrast(words), self._differing.min(axis=0)) if old.any() else None

    def learn(self, words: Words, before: Words) -> None:
        """Learn by how much a good field differs from the previous good one of its parity."""
        self._differing[self._lessons % _LEARNED] = (words != before).sum(axis=1)
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
    # A word equals itself turned by a byte only if its eight pixels are alike.
    turned = (words >> np.uint64(8)) | (words << np.uint64(56))
    contrast: NDArray[np.int64] = (words != turned).sum(axis=1)
    return contrast


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
    lower = rows[_SNOW_EVERY_ROW::_SNOW_EVERY_ROW]
    if not lower.size or cv2.meanStdDev(lower)[1].item() < _SNOW_SIGMA:
        return None
    upper = rows[_SNOW_EVERY_ROW - 1 : -1 : _SNOW_EVERY_ROW]
    with np.errstate(invalid="ignore"):  # a flat sample has no correlation (NaN) and is not snow
        correlation = np.corrcoef(upper.ravel(), lower.ravel())[0, 1]
    return SNOW if correlation < _SNOW_CORRELATION else None


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
        copy = self._copied(grabbed)
        hashes = self._stale.hashes(copy.words)
        made_up = no_picture(copy.rows, hashes)
        self._count(made_up)
        content = Content(made_up) if made_up else Content(damage=self._damage(copy, hashes, field))
        self._remember(copy, field.parity, content)
        return content

    def _count(self, made_up: str | None) -> None:
        self._made_up = self._made_up + 1 if made_up else 0
        self.no_picture = made_up if self._made_up >= _FOR_A_WHILE else None

    def _start(self, shape: tuple[int, int]) -> None:
        self._shape = shape
        words = -(-shape[1] // _WORD)
        self._spare: list[Words] = []
        self._stale = StaleRows(shape[0], words)
        self._good: dict[int, _Copy] = {}
        self._before: _Copy | None = None
        self._newest_good: _Copy | None = None
        self._shift: Shift | None = None
        self._shifted = 0

    def _copied(self, grabbed: GrabbedField) -> _Copy:
        size = self._shape[0], -(-self._shape[1] // _WORD)
        words = self._spare.pop() if self._spare else np.zeros(size, np.uint64)
        rows = words.view(np.uint8)[:, : self._shape[1]]
        rows[:] = grabbed.field.luma
        return _Copy(words, rows, profiles(rows), grabbed.time_ns)

    def _damage(self, copy: _Copy, hashes: Words, field: Field) -> str | None:
        stale = self._stale.find(copy.words, hashes)
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
        self._shift = None if self._shifted > _STAYS else shift
        return self._shift

    def _is_recent(self, reference: _Copy | None, copy: _Copy) -> bool:
        return reference is not None and 0 <= copy.time_ns - reference.time_ns <= _REFERENCE_NS

    def _shift_to(self, reference: _Copy | None, copy: _Copy) -> Shift | None:
        if reference is None or not self._is_recent(reference, copy):
            return None
        return find_shift(copy.rows, reference.rows, copy.profiles, reference.profiles)

    def _remember(self, copy: _Copy, parity: int, content: Content) -> None:
        """Keep the last field, and the last good one of each parity; buffers of others are used again."""
        if content.no_picture or content.damage == REPEATED:
            self._spare.append(copy.words)
            return
        before, self._before = self._before, copy
        if before is not None and all(before is not good for good in self._good.values()):
            self._spare.append(before.words)
        if content.damage:
            return
        replaced = self._good.get(parity)
        self._good[parity] = self._newest_good = copy
        if replaced is not None:
            self._stale.learn(copy.words, replaced.words)
            self._spare.append(replaced.words)


def _ends(back: Shift, shift: Shift) -> bool:
    """True if a shift is the other one undone."""
    columns, rows = abs(back.columns + shift.columns), abs(back.row - shift.row)
    return columns <= _BACK_COLUMNS and rows <= _BACK_ROWS


def _line(field: Field, row: int) -> int:
    return field.y0 + row * field.y_step
