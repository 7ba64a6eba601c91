"""Two that take turns, and the ratio of their times: what else the machine does, both have the same of."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

SPREAD = (10, 90)
"""Percentiles of the turns' ratios."""


class Ratio(NamedTuple):
    """Medians over the turns, and how far the turns' ratios spread (10 … 90 %)."""

    ours_us: float
    peer_us: float
    ratio: float
    low: float
    high: float


def ratio(ours_us: Sequence[float], peer_us: Sequence[float]) -> Ratio:
    """Of one median a turn on either side; turn k of ours is compared with turn k of the peer alone.

    Raises:
        ValueError: the sides have not taken the same number of turns, or none.
    """
    if not len(ours_us) == len(peer_us) > 0:
        raise ValueError(f"{len(ours_us)} turns of ours beside {len(peer_us)} of the peer")
    ratios = np.asarray(ours_us) / np.asarray(peer_us)
    low, high = np.percentile(ratios, SPREAD)
    middle = (float(np.median(values)) for values in (ours_us, peer_us, ratios))
    return Ratio(*middle, float(low), float(high))


def take_turns(ways: Mapping[str, Callable[[], Sequence[float]]], turns: int) -> dict[str, list[float]]:
    """Each way's median of every turn; one more turn goes before, to warm up, and is not kept.

    Every other turn goes backwards, so that no way always follows the same one.
    """
    medians: dict[str, list[float]] = {name: [] for name in ways}
    for turn in range(-1, turns):
        for name in list(ways)[:: 1 if turn % 2 else -1]:
            medians[name].append(float(np.median(ways[name]())))
    return {name: values[1:] for name, values in medians.items()}
