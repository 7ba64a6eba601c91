"""What patterns of bits mean, remembered: the table of locales, filled as patterns are seen.

Each pattern is decoded by itself, by the same operations in the same order whatever else is in the field: a
remembered answer is the answer to the last bit.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.measurement.locale_model import Appearance
from grabberd.measurement.locale_patterns import Alike
from grabberd.measurement.locale_table import axes, table

Array = NDArray[np.float64]
Row = tuple[float, ...]

KINDS, MOST_OF_A_KIND = 512, 256
"""So many patterns are kept of each of so many kinds: some 50 MB at most."""


class Posterior(NamedTuple):
    """What the bits of M blobs say.

    Attributes:
        from_anchor_px: (M, 2) mean place, frame pixels; `variance_px2`: (M, 2) its variance.
        evidence: (M,) logarithm of how likely the pattern is at all, up to a constant.
    """

    from_anchor_px: Array
    variance_px2: Array
    evidence: Array

    @classmethod
    def of_rows(cls, rows: list[Row]) -> "Posterior":
        """From a row of five numbers for each blob."""
        values = np.array(rows, np.float64).reshape(-1, 5)
        return cls(values[:, :2], values[:, 2:4], values[:, 4])


class Asked(NamedTuple):
    """Blobs of a kind, and what targets of the kind look like."""

    look: Appearance
    alike: Alike


def decoded(asked: list[Asked]) -> list[Row]:
    """Mean x, y and their variances and the evidence, of every blob of every kind in turn."""
    found: list[Row | None] = []
    unknown: list[_Unknown] = []
    for look, alike in asked:
        known = _known(look, alike.kind.interpolated)
        patterns = alike.patterns()
        rows = [known.get(pattern) for pattern in patterns]
        new = [number for number, row in enumerate(rows) if row is None]
        if new:
            at = [len(found) + number for number in new]
            unknown.append(_Unknown(Asked(look, alike), new, [patterns[number] for number in new], at))
        found += rows
    if unknown:
        _learn(unknown, found)
    return [row for row in found if row is not None]


class _Unknown(NamedTuple):
    """Blobs of a kind whose patterns are new: their numbers in it, their patterns, their places in all."""

    asked: Asked
    numbers: list[int]
    patterns: list[bytes]
    at: list[int]


def _learn(unknown: list[_Unknown], found: list[Row | None]) -> None:
    """Decodes what is new, enters it into `found` and remembers it."""
    each = [likelihoods(one.asked.look, one.asked.alike, np.array(one.numbers)) for one in unknown]
    rows = iter(posterior_rows(np.concatenate(each), unknown[0].asked.look.y_step))
    for one in unknown:
        known = _known(one.asked.look, one.asked.alike.kind.interpolated)
        if len(known) + len(one.at) > MOST_OF_A_KIND:
            known.clear()
        for at, pattern, row in zip(one.at, one.patterns, rows, strict=False):
            found[at] = known[pattern] = row


@lru_cache(maxsize=KINDS)
def _known(look: Appearance, interpolated: bool) -> dict[bytes, Row]:
    return {}


def likelihoods(look: Appearance, alike: Alike, chosen: NDArray[np.int64]) -> NDArray[np.float32]:
    """(C, G) log likelihood of the chosen blobs at every place; a blob has one run at least."""
    one = table(look, alike.window, alike.kind.interpolated)
    count = alike.first[chosen + 1] - alike.first[chosen]
    begin = np.cumsum(count) - count
    run = np.arange(int(count.sum())) + np.repeat(alike.first[chosen] - begin, count)
    of_runs = one.cumulated.take(alike.end[run], axis=0)
    of_runs -= one.cumulated.take(alike.start[run], axis=0)
    found: NDArray[np.float32] = np.add.reduceat(of_runs, begin, axis=0)
    found += one.empty
    return found


def posterior_rows(likelihood: NDArray[np.float32], y_step: int) -> list[Row]:
    """Rows as of `decoded`, from the log likelihoods (M, G) of all places, each as likely before."""
    x, y = axes(y_step)
    greatest = likelihood.max(axis=1)
    weight = np.exp(likelihood - greatest[:, np.newaxis]).reshape(-1, len(y), len(x))
    along_x, along_y = weight.sum(axis=1, dtype=np.float64), weight.sum(axis=2, dtype=np.float64)
    total = along_x.sum(axis=1)
    mean_x, variance_x = _moments(along_x, x, total)
    mean_y, variance_y = _moments(along_y, y, total)
    evidence = greatest + np.log(total / likelihood.shape[1])
    return list(map(tuple, np.stack([mean_x, mean_y, variance_x, variance_y, evidence], axis=1).tolist()))


def _moments(weight: Array, place: Array, total: Array) -> tuple[Array, Array]:
    mean = (weight * place).sum(axis=1) / total
    apart = place - mean[:, np.newaxis]
    return mean, (weight * (apart * apart)).sum(axis=1) / total
