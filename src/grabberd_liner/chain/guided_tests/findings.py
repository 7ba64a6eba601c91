"""Quantities of an analysis as a test shows them: the very rows of its table `quantities`."""

import math
from collections.abc import Sequence

from grabberd_liner.analysis.quantity import Finding, Quantity
from grabberd_liner.chain.guided_tests.outcome import Evidence


def findings_of(one: Evidence, names: Sequence[str]) -> tuple[Finding, ...]:
    """These quantities, in this order; those that an analysis does not know are left out."""
    return tuple(_finding(one, name) for name in names if one.said(name, "title"))


def _finding(one: Evidence, name: str) -> Finding:
    texts = [one.said(name, column) for column in ("title", "unit", "definition", "source")]
    found = one.quantity(name)
    quantity = Quantity(name, *texts)
    if found is None:
        return Finding.missing(quantity, one.said(name, "reason"))
    return Finding(
        quantity,
        float(found.value),
        float(found.sigma) if math.isfinite(float(found.sigma)) else math.nan,
        verdict=one.said(name, "verdict"),
        common=one.common(name),
    )
