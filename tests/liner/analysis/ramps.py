"""Slow ramps of the pressure difference with an empty liner, from walls that were solved as solids."""

import numpy as np

from grabberd.core.reconstruction import Points
from grabberd_liner.analysis.load.collapse import RampLevel
from grabberd_liner.analysis.load.wall_model import Difference
from grabberd_liner.analysis.wall.material import Material
from liner.analysis.walls import EIGHT_BITS_MM, SolvedLiner, as_points, solved

BROAD = {"E_mpa": 0.2, "wall_mm": 0.05, "F0_n": 0.3}
"""Relative σ of what is known of a liner before its ramp."""
_SIGMAS = {"E_mpa": "E_sigma_mpa", "wall_mm": "wall_sigma_mm", "F0_n": "F0_sigma_n"}


def empty(design: str) -> SolvedLiner:
    """The liner without a teat."""
    return solved(f"{design}-empty")


def solved_kpa(liner: SolvedLiner, first=0.0, last=np.inf) -> np.ndarray:
    """Pressure differences at which the wall was solved itself: between them it is interpolated."""
    solved_at = liner.states.outer_kpa
    return solved_at[(solved_at >= first) & (solved_at <= last)]


def ramp(liner: SolvedLiner, kpa, seed=0, own_kpa=0.1, common_kpa=0.0) -> list[RampLevel]:
    """Levels whose pressure differences err on their own, and all alike."""
    rng = np.random.default_rng(seed)
    read_kpa = kpa + common_kpa * rng.normal() + own_kpa * rng.normal(size=len(kpa))
    return [
        RampLevel(liner.points(true, 1000 * seed + index, EIGHT_BITS_MM), Difference(read, own_kpa))
        for index, (true, read) in enumerate(zip(kpa, read_kpa, strict=True))
    ]


def guessed(liner: SolvedLiner, young=1.0, thickness=1.0, pretension=1.0) -> Material:
    """The liner's material as it is known before the ramp, off by these factors."""
    design = liner.design
    values = {
        "E_mpa": design["young_mpa"] * young,
        "wall_mm": design["wall_mm"] * thickness,
        "F0_n": design["pretension_n"] * pretension,
    }
    sigmas = {_SIGMAS[name]: values[name] * BROAD[name] for name in values}
    (zone,) = liner.zones(**values, **sigmas)
    return zone.material


def open_liner(liner: SolvedLiner) -> Points:
    """Its targets without a pressure difference, averaged over many fields."""
    return as_points(liner.places_mm(0.0), np.full(3, 0.005))
