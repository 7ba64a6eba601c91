"""Stale rows: rows of a live field that the device has delivered before.

The noise of an analog signal never repeats: a row identical to an earlier one bit for bit is stale, provided
it has enough noise for a match to mean anything. How much it has is learned from the stream itself, by
counting the groups of eight pixels that differ from one field to the next: clipped black has none.
"""

import numpy as np
from numpy.typing import NDArray

REPEATED = "repeated"

_REMEMBERED = 64
"""Fields: with 32 buffers, a driver may hand out what it received up to 32 frames ago."""
_LEARNED = 8
"""Field pairs over which the least difference counts, so that one lively pair proves nothing."""
_EVIDENCE = 40.0
"""Pixel groups that should have differed: by chance all are equal less than once in e⁴⁰ fields."""

Words = NDArray[np.uint64]


class StaleRows:
    """Memory of a stream's rows, searched for repetitions.

    Args:
        rows: Number of rows of a field.
        words: Number of groups of eight pixels in a row.
    """

    def __init__(self, rows: int, words: int) -> None:
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
    turned = (words >> np.uint64(8)) | (words << np.uint64(56))
    contrast: NDArray[np.int64] = (words != turned).sum(axis=1)
    return contrast
