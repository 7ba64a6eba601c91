"""The liner's own values as quantities of the field: from a ramp with the empty liner."""

from collections.abc import Iterable, Mapping

import numpy as np

from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.load.ramp.collapse import Collapse
from grabberd_liner.analysis.load.ramp.empty_ramp import LinerValues
from grabberd_liner.analysis.quantity import Finding, Quantity

_Found = tuple[tuple[Estimate, float], ...]
"""Estimates, each with the part of its σ that other ramps share."""
_BY_RAMP = "found as the values of an empty wall in equilibrium, from a ramp of the pressure difference"

COLLAPSE: Mapping[str, Quantity] = {
    one.name: one
    for one in (
        Quantity(
            "touch_kpa",
            "touch point pressure difference (TPPD)",
            "kPa",
            "Pressure difference at which opposite walls of the empty liner just touch.",
            "ISO 3918; from the distance of the walls over the pressure difference, drawn on to the touch",
        ),
        Quantity(
            "buckling_kpa",
            "critical collapsing pressure difference (CCPD)",
            "kPa",
            "Pressure difference at which the empty liner buckles: where the line of the open wall meets the "
            "steepest fall of the buckling one.",
            "critical collapsing pressure difference as in milking research",
        ),
    )
}
VALUES: Mapping[str, Quantity] = {
    one.name: one
    for one in (
        Quantity(
            "stiffness_n_mm",
            "bending stiffness of the liner",
            "N mm",
            "E t³ / 12 (1 − ν²) of the mounted liner's wall: better known than its parts.",
            _BY_RAMP,
        ),
        Quantity("E_mpa", "Young's modulus of the liner", "MPa", "Modulus of the mounted liner.", _BY_RAMP),
        Quantity(
            "wall_mm", "thickness of the liner", "mm", "Thickness of the mounted liner's wall.", _BY_RAMP
        ),
        Quantity("F0_n", "pretension of the liner", "N", "Force along the mounted liner.", _BY_RAMP),
    )
}


def ramp_quantities(
    values: LinerValues | None, collapse: Collapse | None, reasons: tuple[str, str]
) -> tuple[Finding, ...]:
    """Quantities of a ramp; the reasons are why there are no values, and no collapse."""
    return (
        *_findings(COLLAPSE.values(), _of_collapse(collapse) if collapse else (), reasons[1]),
        *_findings(VALUES.values(), _of_values(values) if values else (), reasons[0]),
    )


def _of_collapse(found: Collapse) -> _Found:
    return (found.touch_kpa, found.touch_common_kpa), (found.buckling_kpa, found.buckling_common_kpa)


def _of_values(values: LinerValues) -> _Found:
    parts = np.array([values.E_mpa, values.wall_mm, values.F0_n])
    estimates = (values.stiffness_n_mm, *map(Estimate, parts, parts * values.sigma))
    relative = np.roll(values.common_sigma, 1)
    return tuple((one, float(one.value * shared)) for one, shared in zip(estimates, relative, strict=True))


def _findings(quantities: Iterable[Quantity], found: _Found, reason: str) -> tuple[Finding, ...]:
    if not found:
        return tuple(Finding.missing(quantity, reason) for quantity in quantities)
    return tuple(Finding.of(quantity, *one) for quantity, one in zip(quantities, found, strict=True))
