"""Repeated pictures: which fields show again what a recorder or a dongle has given before.

A recorder at a constant rate fills a gap with the picture before it, a converter from 24 to 25 pictures a
second repeats every 24th, a dongle may give each twice. Such a picture is of no new moment. It is known by
its bright pixels, where a camera's noise and movement change every picture, and one that was coded once more
hardly any: means over the whole picture would drown that in black.
"""

from collections import Counter, deque
from collections.abc import Sequence
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array
from grabberd.core.field import Field, quantise
from grabberd.core.measurement import ANY_DISC, measure

Picture = NDArray[np.uint8]

_REPEATED = (0.5, 1.0)
"""Mean change of the bright pixels, in grey levels, below which a picture repeats the one before: the first
always, up to the second where pictures change by much more. Coded again at a usual quality, a picture changes
by .0 to .6; a camera's noise alone changes the next one by 3 to 20.
"""
_OF_OTHERS = 0.2
"""Share of the least change of late from one picture to the next that is still no change."""
_LATE = 32
_FEWEST_BRIGHT, _LEAST_CONTRAST = 64, 20
"""Pixels that are brighter than a peak, so that hot ones are none; and its height, in grey levels."""
_NEAR_PX, _NEIGHBOURS = 6.0, 8
"""Distance within which a target is found again; targets whose common movement counts, since the noise of
each alone would hide it.
"""
_AT_REST_PX, _MOST_GONE = 0.25, 0.2
"""Root mean square of that movement, and share of targets not found again, up to which nothing moved."""


def bright_change(picture: Picture, before: Picture) -> float:
    """Mean absolute change, in grey levels, of the pixels that are bright in either picture.

    Args:
        picture: (rows, columns) uint8.
        before: the same, of the picture before.
    """
    brighter = np.maximum(picture, before)
    bright = (brighter > _level(brighter)).view(np.uint8)
    return float(cv2.mean(cv2.absdiff(picture, before), mask=bright)[0])


def _level(picture: Picture) -> int:
    """Grey level halfway up to the targets; −1, so that all pixels count, where nothing stands out."""
    counts = cv2.calcHist([picture], [0], None, [256], [0, 256]).ravel()
    peak = int(np.flatnonzero(np.cumsum(counts[::-1])[::-1] >= min(_FEWEST_BRIGHT, picture.size))[-1])
    background = int(np.searchsorted(np.cumsum(counts), picture.size / 2))
    return (peak + background) // 2 if peak - background >= _LEAST_CONTRAST else -1


class RepeatJudge:
    """Judges the fields of a stream, one after another.

    Args:
        of_any_parity: True if each field was a picture of its own, so that a repeated one is like the field
            right before it; fields of woven frames are like the last one of their own parity.
    """

    def __init__(self, *, of_any_parity: bool) -> None:
        self._of_any = of_any_parity
        self._last: dict[int, Field] = {}
        self._newest: Field | None = None
        self._changes: deque[float] = deque(maxlen=_LATE)

    def take(self, field: Field) -> bool:
        """True if the field repeats an earlier one. It is kept as it is: it must stay unchanged."""
        before = self._last.get(field.parity), self._newest if self._of_any else None
        self._last[field.parity] = self._newest = field
        changes = [
            bright_change(field.luma, one.luma)
            for one in before
            if one is not None and one.luma.shape == field.luma.shape
        ]
        if not changes:
            return False
        least, most = _REPEATED
        limit = float(np.clip(_OF_OTHERS * min(self._changes, default=0.0), least, most))
        if min(changes) < limit:
            return True
        self._changes.append(min(changes))
        return False


def moved(before: Field, after: Field) -> bool:
    """True if the targets of two fields of one parity are not where they were, or cannot be compared."""
    old, new = _places(before), _places(after)
    if not len(old) or not len(new):
        return True
    far = np.linalg.norm(old[:, np.newaxis] - new, axis=2)
    nearest = far.argmin(axis=1)
    found = far[np.arange(len(old)), nearest] < _NEAR_PX
    if found.mean() < 1 - _MOST_GONE:
        return True
    steps, places = (new[nearest] - old)[found], old[found]
    apart = np.linalg.norm(places[:, np.newaxis] - places, axis=2)
    nearest_to_each = np.argsort(apart, axis=1)[:, :_NEIGHBOURS]
    return bool(np.sqrt((steps[nearest_to_each].mean(axis=1) ** 2).sum(axis=1).mean()) > _AT_REST_PX)


def _places(field: Field) -> Array:
    """(N, 2) frame pixels of whatever is bright."""
    level = _level(field.luma)
    return measure(quantise(field, 8, level), None, ANY_DISC).xy_px if level >= 0 else np.empty((0, 2))


def repetitions(repeats: Sequence[bool], rate_hz: float, what: str = "pictures") -> str:
    """Sentence on what repeats at the start of a recording or stream; empty if nothing does.

    Args:
        repeats: for each of its first pictures, whether it repeats another.
        rate_hz: pictures a second, the repeated ones included; 0 if unknown.
        what: what they are.
    """
    if not (count := sum(repeats)):
        return ""
    how = f" ({words})" if (words := rhythm(repeats)) else ""
    share = 1 - count / len(repeats)
    left = f"{share * rate_hz:.4g} of {rate_hz:.4g} {what} a second" if rate_hz else f"{share:.0%} of them"
    return (
        f"{count} of its first {len(repeats)} {what} repeat the one before{how}: {left} are left. Where "
        "anything moves, repeated ones are not measured."
    )


def rhythm(repeats: Sequence[bool]) -> str:
    """Order in which repeated pictures follow one another, in words; empty where there is none."""
    at = np.flatnonzero(repeats)
    tail = len(repeats) - 1 - max((k for k, one in enumerate(repeats) if not one), default=-1)
    if tail == len(at) > 1:
        return f"the last {tail}, a frozen end"
    if len(at) < _FEWEST_STEPS:
        return ""
    step, often = Counter(int(later - earlier) for earlier, later in pairwise(at)).most_common(1)[0]
    if often <= _MOSTLY * (len(at) - 1):
        return ""
    return "mostly one after another" if step == 1 else f"every {_ORDINALS.get(step, f'{step}th')}"


_FEWEST_STEPS, _MOSTLY = 3, 0.7
_ORDINALS = {2: "second", 3: "third", 4: "fourth", 5: "fifth", 21: "21st", 22: "22nd", 23: "23rd"}
