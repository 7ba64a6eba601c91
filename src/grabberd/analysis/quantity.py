"""A named quantity with unit, definition and source, and what was found of it."""

from typing import NamedTuple

from grabberd.analysis.estimate import Estimate


class Quantity(NamedTuple):
    """Meaning of a number.

    Attributes:
        name: as in tables and documents.
        title: for people.
        unit: "1" for a ratio.
        definition: one sentence.
        source: where the term is from, and how it is had here if that differs.
    """

    name: str
    title: str
    unit: str
    definition: str
    source: str


class Finding(NamedTuple):
    """Result for a quantity.

    Attributes:
        quantity: which one.
        value: in its unit; NaN if nothing was found.
        sigma: one standard deviation.
        reason: why nothing was found; empty if something was.
        verdict: by the limit that a standard sets; empty if there is none.
    """

    quantity: Quantity
    value: float
    sigma: float
    reason: str = ""
    verdict: str = ""

    @classmethod
    def of(cls, quantity: Quantity, found: Estimate) -> "Finding":
        """A finding."""
        return cls(quantity, float(found.value), float(found.sigma))

    @classmethod
    def missing(cls, quantity: Quantity, reason: str) -> "Finding":
        """Nothing, with the reason."""
        return cls(quantity, float("nan"), float("nan"), reason)
