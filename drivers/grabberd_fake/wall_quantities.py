"""A liner's own quantities from the table of its solved wall: TPPD, CCPD, contact pressure, teat load."""

from typing import NamedTuple

import numpy as np

from grabberd_fake.wall_states import WallStates

_BEFORE_TOUCH = 3
"""States before the touch through which the wall's height is drawn on to it."""


class TeatLoad(NamedTuple):
    """Load of a wall on its teat.

    Attributes:
        mean_kpa: mean contact pressure over the nodes that are pressed by more than a tenth of a kPa.
        peak_kpa: greatest contact pressure at a node.
        peak_n_per_mm: greatest load per height, on one side.
        force_n: load on one side from the mouthpiece to the teat's end.
    """

    mean_kpa: float
    peak_kpa: float
    peak_n_per_mm: float
    force_n: float


def touch_kpa(states: WallStates) -> float:
    """TPPD: pressure difference at which opposite walls of the empty liner meet.

    The wall's height over the pressure difference, continued from the states before the touch, reaches there
    the height that it has in the first state with contact.

    Raises:
        ValueError: the table has a teat, or its walls do not meet.
    """
    _require_empty(states)
    contact = states.contact_states_kpa
    touching = np.flatnonzero(contact.max(axis=(1, 2)) > 0)
    if not len(touching):
        raise ValueError(f"the walls of {states.name} do not meet up to {states.outer_kpa[-1]:g} kPa")
    first = int(touching[0])
    section, _ = np.unravel_index(int(contact[first].argmax()), contact[first].shape)
    before = slice(first - _BEFORE_TOUCH, first)
    above_mm = states.outer_states_mm[:, section, 0, 2] - states.outer_states_mm[first, section, 0, 2]
    return float(np.polyfit(above_mm[before], states.outer_kpa[before], _BEFORE_TOUCH - 1)[-1])


def buckling_kpa(states: WallStates) -> float:
    """CCPD: pressure difference at which the empty liner buckles.

    It is where two straight lines meet: the height of the section that closes first, over the pressure
    difference, near no difference, and where it falls most steeply.

    Raises:
        ValueError: the table has a teat.
    """
    _require_empty(states)
    heights_mm = states.outer_states_mm[:, :, 0, 2].astype(np.float64)
    slopes = np.diff(heights_mm, axis=0) / np.diff(states.outer_kpa)[:, np.newaxis]
    steepest, section = np.unravel_index(int(slopes.argmin()), slopes.shape)
    open_ = int(np.searchsorted(states.outer_kpa, 0.0))
    height_mm, slope = heights_mm[:, section], slopes[:, section]
    middle_kpa = states.outer_kpa[steepest : steepest + 2].mean()
    middle_mm = height_mm[steepest : steepest + 2].mean()
    at_zero_mm = middle_mm - slope[steepest] * middle_kpa
    return float((height_mm[open_] - at_zero_mm) / (slope[steepest] - slope[open_]))


def stiffness_n_mm(states: WallStates) -> float:
    """Bending stiffness E t³ / 9 of an incompressible wall, as designed."""
    design = states.about["design"]
    return float(design["young_mpa"] * design["wall_mm"] ** 3 / 9)


def teat_load(states: WallStates, outer_kpa: float) -> TeatLoad:
    """Load on the teat at a pressure difference; walls that meet below its end are left out.

    Raises:
        ValueError: the table has no teat.
    """
    if states.about["teat"] is None:
        raise ValueError(f"{states.name} has no teat")
    end_mm = states.about["teat"]["end_x_mm"]
    contact = states.contact_kpa(outer_kpa)[states.outer_mm(outer_kpa)[:, 0, 0] < end_mm]
    force, borders_mm = states.force_n_per_mm(outer_kpa), states.borders_mm(outer_kpa)
    beside_mm = np.clip(end_mm, borders_mm[:-1], borders_mm[1:]) - borders_mm[:-1]
    return TeatLoad(
        mean_kpa=float(contact[contact > 0.1].mean()) if (contact > 0.1).any() else 0.0,
        peak_kpa=float(contact.max()),
        peak_n_per_mm=float(force[beside_mm > 0].max()),
        force_n=float(force @ beside_mm),
    )


def _require_empty(states: WallStates) -> None:
    if states.about["teat"] is not None:
        raise ValueError(f"{states.name} has a teat: choose the empty liner")
