"""Verdicts on differences and trends, and what their σ is by."""

import math

from grabberd_liner.analysis.study.comparison import Difference
from grabberd_liner.analysis.study.contrast import Contrast

CERTAIN = 0.05
"""Probability below which a difference is believed."""
DIFFER, SAME, CHANGES, STEADY = "differ", "no difference shown", "changes", "no change shown"
UNTESTED = "not tested"
BY_SCATTER, BY_OWN, BY_OWN_ALONE = "scatter", "own σ", "own σ alone"


def basis(found: Contrast) -> str:
    """Origin of the σ of a result: the scatter, or the captures' own σ."""
    if not math.isfinite(found.dof):
        return BY_OWN_ALONE
    return BY_OWN if found.by_sigma else BY_SCATTER


def difference_verdict(difference: Difference) -> str:
    """Verdict on two groups."""
    if not math.isfinite(difference.adjusted_p):
        return UNTESTED
    return DIFFER if difference.adjusted_p < CERTAIN else SAME


def slope_verdict(slope: Contrast) -> str:
    """Verdict on a trend."""
    if not math.isfinite(slope.p):
        return UNTESTED
    return CHANGES if slope.p < CERTAIN else STEADY


def whole_verdict(verdicts: list[str]) -> str:
    """Verdict on a quantity by those on its pairs; empty if there are none."""
    return next((one for one in (DIFFER, SAME, UNTESTED) if one in verdicts), "")
