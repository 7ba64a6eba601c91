"""Values of one quantity from several captures, each with its own σ and with what it shares with others."""

from collections.abc import Hashable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Levels = NDArray[np.int64]


class Observations(NamedTuple):
    """N values of a quantity.

    Attributes:
        value: (N,) values.
        own: (N,) σ of each that is independent of all others; NaN where it is not known.
        shared: (N, S) σ of each by S causes that captures share. The errors by one cause go together in full,
            those by different causes are independent.
        unsplit: (N,) σ of each of which nobody knows how much is shared: `shared` has all of it, `own` none.
    """

    value: Array
    own: Array
    shared: Array
    unsplit: Array

    def taken(self, rows: NDArray[np.bool_] | Levels) -> "Observations":
        """Some of them."""
        return Observations(*(part[rows] for part in self))


def observations(value: Array, sigma: Array, common: Array, share: Sequence[Hashable]) -> Observations:
    """Values whose σ has a part in common with those of the same share.

    Args:
        value: (N,) values.
        sigma: (N,) the whole σ of each; NaN where it is not known.
        common: (N,) the part of it that the share has in common; NaN where it is not known.
        share: N names of shares: captures of one share err together.
    """
    levels = levels_of(share)
    known, whole = np.isfinite(common), np.nan_to_num(sigma)
    part = np.where(known, np.nan_to_num(common), whole)
    shared = np.zeros((len(levels), int(levels.max(initial=-1)) + 1))
    shared[np.arange(len(levels)), levels] = part
    own = np.sqrt(np.maximum(np.square(sigma) - np.square(part), 0.0))
    return Observations(np.asarray(value, np.float64), own, shared, np.where(known, 0.0, whole))


def levels_of(names: Sequence[Hashable]) -> Levels:
    """(N,) numbers from 0 for names, in the order in which they first appear."""
    seen: dict[Hashable, int] = {}
    return np.array([seen.setdefault(name, len(seen)) for name in names], dtype=np.int64)


def cell_means(observed: Observations, cell: Levels) -> Observations:
    """(C,) means of the observations of each cell; a mean shares what its observations share.

    Args:
        observed: N observations.
        cell: (N,) cell of each, from 0 to C - 1.
    """
    if int(cell.max(initial=-1)) + 1 == len(cell):
        return observed.taken(np.argsort(cell))
    member = (cell[None, :] == np.arange(cell.max(initial=-1) + 1)[:, None]).astype(np.float64)
    weights = member / member.sum(axis=1, keepdims=True)
    own, unsplit = (np.sqrt(np.square(weights) @ np.square(one)) for one in (observed.own, observed.unsplit))
    return Observations(weights @ observed.value, own, weights @ observed.shared, unsplit)
