"""Rows of a live field that the device has delivered before.

The noise of an analog signal never repeats: a row identical to an earlier one bit for bit is stale, provided
it has enough noise for a match to mean anything. How much it has is learned from the stream itself, by
counting the groups of eight pixels that differ from one field to the next: clipped black has none.
"""

import numpy as np
from numpy.typing import NDArray

REMEMBERED = 64
"""Fields: with 32 buffers, a driver may hand out what it received up to 32 frames ago."""
_LEARNED = 8
"""Field pairs over which the least difference counts, so that one lively pair proves nothing."""
_EVIDENCE = 40
"""Pixel groups that should have differed: by chance all are equal less than once in e⁴⁰ fields."""

Words = NDArray[np.uint64]


class StaleRows:
    """Memory of a stream's rows, searched for repetitions.

    Args:
        rows: Number of rows of a field.
        words: Number of groups of eight pixels in a row.

    Attributes:
        memory: Everything below in one array, as the kernel takes it.
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
        """Index of the next field among those remembered."""
        return self._fields % REMEMBERED

    def hash(self, words: Words) -> None:
        """Hash each of a field's rows (rows, words)."""
        np.einsum("ij,j", words, self._weights, out=self.hashes)

    def compare(self, words: Words, good: Words) -> None:
        """Compare a field with the last good one of its parity."""
        self.differing[:] = (words != good).sum(axis=1)

    def find(self, words: Words) -> tuple[int, int] | None:
        """Find the first and last stale row of the hashed field, or None, and write it into the memory.

        Rows without contrast at the ends of a stale run are not counted. A wholly stale field is found from
        the first field on, a partly stale one only once it is known how much fields differ.
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
    # A word equals itself turned by a byte only if its eight pixels are alike.
    turned = (words >> np.uint64(8)) | (words << np.uint64(56))
    contrast: NDArray[np.int64] = (words != turned).sum(axis=1)
    return contrast
