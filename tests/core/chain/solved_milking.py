"""Captures of a liner that was solved as a solid: points, the vacuum beside it, and what is true."""

from functools import cache

from grabberd_liner.analysis.pulsation.movement import TimedPoints
from grabberd_liner.chain.analysis.analyse import analyse
from grabberd_liner.chain.analysis.inputs import read_inputs
from grabberd_liner.chain.analysis.wall_state import FieldPoints
from liner.analysis.walls import solved

FIELD_S, LINER_KPA = 0.02, 42.0
DIFFERENCES_KPA = (0.0, 24.0, 24.3)
"""Over the wall, field by field: open, and closing on the teat."""
LINER = "reference-round"


def material(**changed):
    """As known from a ramp with the empty liner."""
    (zone,) = solved(LINER).zones()
    names = ("E_mpa", "wall_mm", "poisson", "F0_n", "radius_mm", "target_mm", "law")
    ends_and_sigma = ("first_end_mm", "last_end_mm", "E_sigma_mpa", "wall_sigma_mm", "F0_sigma_n")
    return {name: getattr(zone.material, name) for name in (*names, *ends_and_sigma)} | changed


def vacuum(differences_kpa=DIFFERENCES_KPA):
    """A log whose vacuum is constant for as long as a field lasts, and changes between two."""
    lines = ["time_s,pulsation_vacuum_kpa,liner_vacuum_kpa"]
    for n, difference_kpa in enumerate(differences_kpa):
        at_s = ((n + share) * FIELD_S for share in (-0.4, -0.2, 0.0, 0.2, 0.4))
        lines += [f"{one:.3f},{LINER_KPA - difference_kpa},{LINER_KPA}" for one in at_s]
    return {
        "pulsation": "log",
        "liner": "log",
        "log": "\n".join(lines),
        "offset": {"s": 0, "sigma_s": 0.0005},
    }


def fields(differences_kpa=DIFFERENCES_KPA):
    """Points of the fields."""
    liner = solved(LINER)
    each = enumerate(differences_kpa)
    return [FieldPoints(n, TimedPoints(n * FIELD_S, liner.points(kpa, n))) for n, kpa in each]


def analysed(differences_kpa=DIFFERENCES_KPA, **inputs):
    """One analysis; the inputs are complete but for those that are given."""
    grid = solved(LINER).grid
    document = {
        "reference": {"field": 0},
        "material": material(),
        "vacuum": vacuum(differences_kpa),
        "plane": {"point_mm": [0, 0, 0], "normal": [0, 0, 1]},
        "sought_kpa": 1.0,
    } | inputs
    given = {key: value for key, value in document.items() if value is not None}
    return analyse([fields(differences_kpa)], grid, read_inputs(given, grid))


@cache
def whole():
    """With all that there is."""
    return analysed()
