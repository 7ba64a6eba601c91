"""Noise in the choice of a teat's heights: what it adds to sums over them."""

from typing import NamedTuple

import numpy as np

from grabberd.errors import AnalysisError
from grabberd_liner.analysis.load.compression.closed_liner import TeatHeights, teat_heights
from grabberd_liner.analysis.load.compression.load_profile import LoadProfile

_DRAWS, _SEED = 200, 5
"""Of profiles: σ to 5 %."""


class ChosenHeights(NamedTuple):
    """Variances of sums over the teat by the noise in where it begins and ends.

    Attributes:
        mean_kpa2: of the mean compression; `load_n2`: of the load; `end_kpa2`: of the compression at its end.
    """

    mean_kpa2: float
    load_n2: float
    end_kpa2: float

    @classmethod
    def of(cls, closed: LoadProfile, heights: TeatHeights) -> "ChosenHeights":
        """Draws of the noise: sums over heights chosen anew, less those over the heights that were chosen."""
        if closed.noise is None:
            return cls(0.0, 0.0, 0.0)
        covariance, count = closed.noise.covariance, len(closed.x_mm)
        values, vectors = np.linalg.eigh(covariance)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        noise = np.random.default_rng(_SEED).normal(size=(_DRAWS, 3 * count)) @ root.T
        pairs = []
        for compression, load, gap in noise.reshape(_DRAWS, 3, count):
            drawn = closed.moved(compression, load, gap)
            try:
                pairs.append((_three(drawn, teat_heights(drawn)), _three(drawn, heights)))
            except AnalysisError:  # too little is pressed: such noise would have said so
                continue
        anew, same = np.array(pairs).reshape(-1, 2, 3).transpose(1, 0, 2)
        known = np.isfinite(anew)
        more = [
            float(np.var(anew[use, k]) - np.var(same[use, k])) if use.sum() > 1 else 0.0
            for k, use in enumerate(known.T)
        ]
        return cls(*(max(one, 0.0) for one in more))


def _three(profile: LoadProfile, heights: TeatHeights) -> tuple[float, float, float]:
    """Mean compression, load, and compression at the teat's end; NaN without one."""
    over = profile.spans_within(heights.first_mm, heights.last_mm)
    kpa = profile.compression_kpa.value
    at_end = np.nan
    if heights.end_mm is not None:
        last = profile.spans_within(*heights.last_of_teat_mm)
        at_end = float(kpa @ last / last.sum())
    return float(kpa @ over / over.sum()), float(profile.load_n_per_mm.value @ over), at_end
