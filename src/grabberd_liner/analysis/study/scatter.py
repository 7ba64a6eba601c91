"""The scatter of repeated captures against their own σ."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc

from grabberd_liner.analysis.study.observations import Array, Levels, Observations


class ScatterCheck(NamedTuple):
    """Test of whether repetitions differ by their own σ alone.

    Attributes:
        chi2: weighted square of the departures; about `dof` if they do.
        dof: degrees of freedom; 0 where nothing was repeated, or a σ is not known.
        p: probability of a larger one if they do; NaN without freedom.
    """

    chi2: float
    dof: int
    p: float


def scatter_check(observed: Observations, design: Array, effects: Sequence[Levels] = ()) -> ScatterCheck:
    """Compare the departures from a model with the observations' own σ.

    Args:
        observed: N values.
        design: (N, P) the model's columns.
        effects: (N,) levels of what may differ besides.
    """
    if not (observed.own > 0).all() or (observed.unsplit > 0).any():
        return ScatterCheck(np.nan, 0, np.nan)
    columns = [design, *((levels[:, None] == np.unique(levels)) * 1.0 for levels in effects)]
    weighted = np.hstack(columns) / observed.own[:, None]
    value = observed.value / observed.own
    solution, _, rank, _ = np.linalg.lstsq(weighted, value, rcond=None)
    dof = len(value) - int(rank)
    if dof == 0:
        return ScatterCheck(np.nan, 0, np.nan)
    chi2 = float(np.sum(np.square(value - weighted @ solution)))
    return ScatterCheck(chi2, dof, float(chdtrc(dof, chi2)))
