"""Rows of a field that a live device has delivered before.

The noise of an analog signal never comes twice: a row that equals an earlier one to the bit is old, if it has
enough noise for that to mean anything. How much it has is learned from the stream itself, by how many groups
of eight pixels differ from each field to the next: black that is clipped has none.
"""

import numpy as np
from numpy.typing import NDArray

REPEATED = "repeated"

_REMEMBERED = 64
"""Fields: a driver's buffer holds what was in it up to 32 frames ago."""
_LEARNED = 8
_EVIDENCE = 40.0
"""Groups of pixels that should have differed: by chance they are all equal less than once in e⁴⁰ fields."""

Words = NDArray[np.uint64]


class StaleRows:
    """Remembers a stream's rows.

    Args:
        rows: of a field; `words`: groups of eight pixels in a row.
    """

    def __init__(self, rows: int, words: int) -> None:
        random = np.random.default_rng(words)
        self._weights: Words = random.integers(0, 2**63, words, np.uint64) * np.uint64(2) + np.uint64(1)
        self._seen: Words = np.zeros((_REMEMBERED, rows), np.uint64)
        self._differing: NDArray[np.int64] = np.zeros((_LEARNED, rows), np.int64)
        self._fields = self._lessons = 0

    def hashes(self, words: Words) -> Words:
        """(rows,) numbers that are equal where rows are equal; words (rows, words)."""
        hashes: Words = np.einsum("ij,j", words, self._weights)
        return hashes

    def find(self, words: Words, hashes: Words) -> tuple[int, int] | None:
        """The first and the last row of what is old, or None; remembers the field.

        What is found without contrast around it is not counted in. A whole field that is old is found from
        the first field on, a part of one only when it is known how much fields differ.
        """
        old = (self._seen == hashes).any(axis=0)
        self._seen[self._fields % _REMEMBERED] = hashes
        self._fields += 1
        return _found(old, _contrast(words), self._differing.min(axis=0)) if old.any() else None

    def learn(self, words: Words, before: Words) -> None:
        """By how much a good field differs from the good one of its parity before."""
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
    """First indices of the runs of True, and the indices after them."""
    steps = np.diff(np.concatenate(([False], mask, [False])).astype(np.int8))
    return np.flatnonzero(steps == 1), np.flatnonzero(steps == -1)


def _contrast(words: Words) -> NDArray[np.int64]:
    """(rows,) how many groups of eight pixels are not of one grey value."""
    turned = (words >> np.uint64(8)) | (words << np.uint64(56))
    contrast: NDArray[np.int64] = (words != turned).sum(axis=1)
    return contrast
