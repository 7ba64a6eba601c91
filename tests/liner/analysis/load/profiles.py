"""Loads over height: of closed liners, made up, and of a wall that was solved as a solid."""

from functools import cache

import numpy as np

from grabberd_liner.analysis.estimate import Estimate, Joint
from grabberd_liner.analysis.load.load_profile import LoadProfile
from grabberd_liner.analysis.load.pressure import ChamberVacuum, PressureModel
from liner.analysis.walls import as_points, pressure_map, solved

X_MM = np.arange(-55.0, 56.0, 5.0)
TEAT_END_MM = 15.0
DIFFERENCES_KPA = (15.0, 26.0)
"""At the second, the solved liner has closed on its teat and below it."""
SIGMA_KPA, SIGMA_N_PER_MM = 1.0, 0.02


def closed(scale=1.0, upside_down=False, empty=False, pressed=True, below=True):
    """A teat that ends at 15 mm, with walls that meet below it and press each other there.

    Args:
        scale: of the load.
        upside_down: the teat comes from high x.
        empty: no teat: the walls meet wherever they are pressed.
        pressed: false for a liner that is open.
        below: false if the tube does not close below the teat.
    """
    teat = X_MM <= TEAT_END_MM
    load = np.where(teat, 0.3 + 0.01 * (X_MM + 55), np.where(X_MM < 45, 0.5, 0.0)) * scale * pressed
    gap_mm = np.where(teat, 20 - 0.12 * (X_MM + 55), np.where(X_MM < 45, 0.1, 12.0))
    if empty:
        load, gap_mm = np.where(np.abs(X_MM) < 45, 0.5, 0.0), np.where(np.abs(X_MM) < 45, 0.1, 12.0)
    if not below:
        load, gap_mm = np.where(teat, load, 0.0), np.where(teat, gap_mm, 14.0)
    if not pressed:
        gap_mm = np.full(len(X_MM), 22.0)
    if upside_down:
        load, gap_mm = load[::-1], gap_mm[::-1]
    return LoadProfile(
        X_MM,
        Joint(40.0 * load, correlated(SIGMA_KPA)),
        Joint(load, correlated(SIGMA_N_PER_MM)),
        np.full(len(X_MM), 1.02),
        Estimate(gap_mm, np.full(len(X_MM), 0.1)),
    )


def correlated(sigma):
    """Covariance of errors that go together over 6 mm."""
    return sigma**2 * np.exp(-0.5 * ((X_MM[:, np.newaxis] - X_MM) / 6.0) ** 2)


def pressure_model(liner):
    """Its material is known as after a ramp with the empty liner."""
    open_liner = as_points(liner.places_mm(0.0), np.full(3, 0.005))
    return PressureModel(liner.grid, liner.zones(), open_liner, 50.0)


def vacuum(outer_kpa):
    """The vacuum that makes a pressure difference."""
    return ChamberVacuum(42.0 - outer_kpa, 42.0, 0.35, 0.35)


@cache
def solved_profiles(name):
    """Profiles of a liner that closes on its teat, at `DIFFERENCES_KPA`."""
    liner, model = solved(name), pressure_model(solved(name))
    seen = np.ones(len(liner.grid), bool)
    return [
        pressure_map(model, liner.points(kpa, seed), seen, vacuum(kpa)).profile
        for seed, kpa in enumerate(DIFFERENCES_KPA)
    ]
