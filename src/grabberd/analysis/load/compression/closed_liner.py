"""The closed liner: its load over height, averaged over phase d, and the heights at which it presses a teat.

Where there is no teat, opposite walls meet and press each other as hard as they would press a teat. The two
differ in the gap between the walls.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.analysis.estimate import Estimate, Joint
from grabberd.analysis.load.compression.load_profile import LoadProfile
from grabberd.errors import AnalysisError

Array = NDArray[np.float64]

CERTAIN = 3.0
"""A load or a gap of more than that many σ is there."""
SHORTEST_TEAT_MM = 10.0
"""Length below which loads are not resolved: a shorter stretch that seems pressed is none."""
LEAST_GAP_MM = 1.0
"""Walls nearer to each other are taken to meet: the mirrored half is never quite the real one."""


class TeatHeights(NamedTuple):
    """Heights at which a closed liner presses the teat.

    Attributes:
        teat: (H,) true from the first to the last height that is pressed and held apart.
        end_mm: where the teat ends, with σ; None if that is not among the heights that are seen.
        reason: why there is no end; empty if there is one.
    """

    teat: NDArray[np.bool_]
    end_mm: Estimate | None
    reason: str


def mean_profile(profiles: Sequence[LoadProfile], weights: Array) -> LoadProfile:
    """Mean over several states at the same heights, with weights (K,) that count by their sum.

    How the errors of different phases go together is not known: the points of a mean cycle share harmonics,
    all states share the liner's modulus, thickness and vacuum. The variance of a mean of correlated errors is
    at most the mean of their variances; that is taken, for every sum over heights.
    """
    share = weights / weights.sum()

    def mean(parts: Sequence[Array]) -> Array:
        return np.asarray(np.tensordot(share, np.stack(parts), axes=1), np.float64)

    def joint(parts: Sequence[Joint]) -> Joint:
        return Joint(mean([one.value for one in parts]), mean([one.covariance for one in parts]))

    gaps = [one.gap_mm for one in profiles]
    return LoadProfile(
        profiles[0].x_mm,
        joint([one.compression_kpa for one in profiles]),
        joint([one.load_n_per_mm for one in profiles]),
        mean([one.length for one in profiles]),
        Estimate(mean([gap.value for gap in gaps]), mean([gap.sigma for gap in gaps])),
    )


def phase_weights(phase: Array, first: float, end: float) -> Array:
    """(P,) part of the cycle that each phase within first ≤ phase < end stands for; 0 for the others.

    Args:
        phase: (P,) from 0 to 1, ascending; each stands for up to halfway to its neighbours.
        first: where the window begins.
        end: where it ends, at most 1.
    """
    around = np.concatenate([phase[-1:] - 1, phase, phase[:1] + 1])
    parts = (around[2:] - around[:-2]) / 2
    weights: Array = np.where((phase >= first) & (phase < end), parts, 0.0)
    return weights


def teat_heights(profile: LoadProfile) -> TeatHeights:
    """The heights at which the closed liner presses the teat, and the teat's end.

    The end is on the side where opposite walls come nearest to each other: there is no teat between them.

    Raises:
        AnalysisError: no teat is pressed.
    """
    load, gap = profile.load_n_per_mm.estimate, profile.gap_mm
    pressed, apart = _pressed(profile), _held_apart(profile)
    runs = [
        run for run in _runs(pressed & apart, ~apart) if np.ptp(profile.x_mm[list(run)]) >= SHORTEST_TEAT_MM
    ]
    if not runs:
        said = "walls that are pressed meet each other" if pressed.any() else "no height is pressed"
        raise AnalysisError(
            f"there is no teat in the closed liner: {said} (least gap {gap.value.min():.1f} mm)",
            "these quantities are those of a liner on a teat; analyse phases in which it is closed",
        )
    first, last = max(runs, key=lambda run: float(load.value[run[0] : run[1] + 1].sum()))
    teat = np.zeros(len(load.value), np.bool_)
    teat[first : last + 1] = True
    nearest = int(np.argmin(gap.value))
    if apart[nearest] or first <= nearest <= last:
        reason = (
            "the teat's end is not among the heights that are seen: nowhere do opposite walls meet "
            f"(least gap {gap.value[nearest]:.1f} mm, at {profile.x_mm[nearest]:.0f} mm)"
        )
        return TeatHeights(teat, None, reason)
    end, beyond = (last, last + 1) if nearest > last else (first, first - 1)
    return TeatHeights(teat, _end_mm(profile, end, beyond), "")


def is_empty(profile: LoadProfile) -> bool:
    """True if the wall presses, but only where opposite walls meet: then it presses itself, and no teat."""
    pressed = _pressed(profile)
    return bool(pressed.any() and not (pressed & _held_apart(profile)).any())


def _pressed(profile: LoadProfile) -> NDArray[np.bool_]:
    load = profile.load_n_per_mm.estimate
    pressed: NDArray[np.bool_] = load.value > CERTAIN * load.sigma
    return pressed


def _held_apart(profile: LoadProfile) -> NDArray[np.bool_]:
    gap = profile.gap_mm
    apart: NDArray[np.bool_] = gap.value - CERTAIN * gap.sigma > LEAST_GAP_MM
    return apart


def _runs(yes: NDArray[np.bool_], broken: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last index of each run of `yes`, over others between but not over `broken` ones."""
    runs: list[tuple[int, int]] = []
    for index in np.flatnonzero(yes):
        if runs and not broken[runs[-1][1] : index].any():
            runs[-1] = (runs[-1][0], int(index))
        else:
            runs.append((int(index), int(index)))
    return runs


def _end_mm(profile: LoadProfile, end: int, beyond: int) -> Estimate:
    """Half a spacing beyond the last pressed height, as uncertain as that is wide and the gap is known."""
    step_mm = profile.x_mm[beyond] - profile.x_mm[end]
    slope = (profile.gap_mm.value[beyond] - profile.gap_mm.value[end]) / step_mm
    by_gap_mm = profile.gap_mm.sigma[end] / max(abs(slope), 1e-3)
    sigma_mm = np.hypot(step_mm / np.sqrt(12), min(by_gap_mm, abs(step_mm)))
    return Estimate(np.asarray(profile.x_mm[end] + step_mm / 2), np.asarray(sigma_mm))
