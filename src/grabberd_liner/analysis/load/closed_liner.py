"""The closed liner: its load over height, averaged over phase d, the heights at which it presses a teat, and
what noise in their choice adds to sums over them.

Where there is no teat, opposite walls meet and press each other as hard as they would press a teat. The two
differ in the gap between the walls.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Estimate, Joint
from grabberd_liner.analysis.load.load_profile import LoadProfile, Noise
from grabberd_liner.arrays import Array, Mask

CERTAIN = 3.0
"""A load or a gap of more than that many σ is there."""
SHORTEST_TEAT_MM = 10.0
"""Length below which loads are not resolved: a shorter stretch that seems pressed is none."""
TEAT_END_MM = 10.0
"""Length of tube, up to the teat's end, over which compression there is averaged: shorter patches blur."""
LEAST_GAP_MM = 1.0
"""Walls nearer to each other are taken to meet: the mirrored half is never quite the real one."""
END_SHARE = 0.5
"""Of the greatest compression: where it has fallen to that, the teat ends.

From its greatest to nothing it falls within a centimetre, which the targets' pitch blurs. The middle of the
fall stays where it is; its foot comes out 1 to 2 mm too far, the mean over the last centimetre 5 to 12 kPa
too low.
"""
_STRAIGHT = 0.15
"""Of the spacing of heights: how far a straight line between two of them misses the end."""


class TeatHeights(NamedTuple):
    """Heights at which a closed liner presses the teat.

    Attributes:
        teat: (H,) true from the first height at which it holds the walls apart to its end.
        first_mm, last_mm: where that stretch of the mounted tube begins and ends.
        end_mm: where the teat ends, with σ; None if that is not among the heights that are seen.
        reason: why there is no end; empty if there is one.
    """

    teat: Mask
    first_mm: float
    last_mm: float
    end_mm: Estimate | None
    reason: str

    @property
    def last_of_teat_mm(self) -> tuple[float, float]:
        """The last `TEAT_END_MM` of a teat that has an end, ascending."""
        assert self.end_mm is not None
        if float(self.end_mm.value) == self.last_mm:
            return max(self.first_mm, self.last_mm - TEAT_END_MM), self.last_mm
        return self.first_mm, min(self.last_mm, self.first_mm + TEAT_END_MM)


def mean_profile(profiles: Sequence[LoadProfile], weights: Array, correlation: Array) -> LoadProfile:
    """Mean over several states at the same heights.

    How the errors of different phases go together is not known: the points of a mean cycle share harmonics,
    all states share the liner's modulus, thickness and vacuum. The variance of a mean of correlated errors is
    at most the mean of their variances; that is taken, for every sum over heights. How the noise of the
    points goes together is known, so that its part of the mean's covariance is.

    Args:
        profiles: of K states.
        weights: (K,) of each, which count by their sum.
        correlation: (K, K) of the noise of the points in two states.
    """
    share = weights / weights.sum()

    def mean(parts: Sequence[Array], by: Array = share) -> Array:
        return np.asarray(np.tensordot(by, np.stack(parts), axes=1), np.float64)

    def joint(parts: Sequence[Joint]) -> Joint:
        return Joint(mean([one.value for one in parts]), mean([one.covariance for one in parts]))

    noises = [one.noise for one in profiles if one.noise is not None]
    # The states of a closed liner are much alike, and so is what each makes of the same noise.
    noise = (
        Noise(
            mean([one.own for one in noises], share * (correlation @ share)),
            mean([one.reference for one in noises]),
        )
        if len(noises) == len(profiles)
        else None
    )
    gaps = [one.gap_mm for one in profiles]
    return LoadProfile(
        profiles[0].x_mm,
        joint([one.compression_kpa for one in profiles]),
        joint([one.load_n_per_mm for one in profiles]),
        mean([one.length for one in profiles]),
        Estimate(mean([gap.value for gap in gaps]), mean([gap.sigma for gap in gaps])),
        noise,
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
    return np.where((phase >= first) & (phase < end), parts, 0.0)


def teat_heights(profile: LoadProfile) -> TeatHeights:
    """The heights at which the closed liner presses the teat, and the teat's end.

    The end is on the side where opposite walls come nearest to each other: there is no teat between them.
    Compression falls off there over a centimetre, so a share of its greatest defines the end: a limit in σ
    would move it with the noise.

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
    nearest = int(np.argmin(gap.value))
    if apart[nearest] or first <= nearest <= last:
        reason = (
            "the teat's end is not among the heights that are seen: nowhere do opposite walls meet "
            f"(least gap {gap.value[nearest]:.1f} mm, at {profile.x_mm[nearest]:.0f} mm)"
        )
        borders_mm = profile.borders_mm
        return _between(profile, float(borders_mm[first]), float(borders_mm[last + 1]), None, reason)
    return _with_end(profile, first, last, 1) if nearest > last else _with_end(profile, last, first, -1)


def is_empty(profile: LoadProfile) -> bool:
    """True if the wall presses, but only where opposite walls meet: then it presses itself, and no teat."""
    pressed = _pressed(profile)
    return bool(pressed.any() and not (pressed & _held_apart(profile)).any())


def _pressed(profile: LoadProfile) -> Mask:
    load = profile.load_n_per_mm.estimate
    return load.value > CERTAIN * load.sigma


def _held_apart(profile: LoadProfile) -> Mask:
    return _margin_mm(profile) > 0


def _margin_mm(profile: LoadProfile) -> Array:
    """(H,) by how much the walls are surely held apart."""
    gap = profile.gap_mm
    return gap.value - CERTAIN * gap.sigma - LEAST_GAP_MM


def _runs(yes: Mask, broken: Mask) -> list[tuple[int, int]]:
    """First and last index of each run of `yes`, over others between but not over `broken` ones."""
    runs: list[tuple[int, int]] = []
    for index in np.flatnonzero(yes):
        if runs and not broken[runs[-1][1] : index].any():
            runs[-1] = (runs[-1][0], int(index))
        else:
            runs.append((int(index), int(index)))
    return runs


def _with_end(profile: LoadProfile, first: int, last: int, step: int) -> TeatHeights:
    """The teat from where it comes into sight to its end.

    Args:
        profile: of the closed liner.
        first: the height from which on it is pressed for certain.
        last: the last one, towards its end.
        step: from one height to the next in this direction.
    """
    end_mm = _end_mm(profile, range(first, last + step, step))
    # Towards the mouthpiece the liner presses less and less. To begin where that is certain would leave out
    # the more, the less certain it is.
    apart = _held_apart(profile)
    while 0 <= first - step < len(apart) and apart[first - step]:
        first -= step
    both_mm = sorted((float(profile.borders_mm[first + (step < 0)]), float(end_mm.value)))
    return _between(profile, both_mm[0], both_mm[1], end_mm, "")


def _between(
    profile: LoadProfile, first_mm: float, last_mm: float, end_mm: Estimate | None, reason: str
) -> TeatHeights:
    teat = (profile.x_mm >= first_mm) & (profile.x_mm <= last_mm)
    return TeatHeights(teat, first_mm, last_mm, end_mm, reason)


def _end_mm(profile: LoadProfile, run: range) -> Estimate:
    """Height at which the compression, beyond its greatest, has fallen to `END_SHARE` of it.

    Where the walls meet before, it is there.
    """
    compression, apart = profile.compression_kpa.value, _held_apart(profile)
    limit_kpa = END_SHARE * compression[list(run)].max()
    at = max(run, key=lambda k: compression[k])
    while apart[at] and compression[at + run.step] > limit_kpa:
        at += run.step
    if not apart[at]:
        at -= run.step
    beyond = at + run.step
    step_mm = profile.x_mm[beyond] - profile.x_mm[at]
    if not apart[beyond]:
        # By the gap, for a height may be held apart or not by chance.
        margin = _margin_mm(profile)
        part = margin[at] / (margin[at] - margin[beyond])
        return Estimate(profile.x_mm[at] + part * step_mm, np.asarray(abs(step_mm) / np.sqrt(12)))
    falls_kpa = compression[at] - compression[beyond]
    part = (compression[at] - limit_kpa) / falls_kpa
    weights = np.zeros(len(apart))
    weights[[at, beyond]] = 1 - part, part
    by_noise_mm = float(profile.compression_kpa.summed(weights).sigma) * abs(step_mm) / falls_kpa
    sigma_mm = np.hypot(by_noise_mm, _STRAIGHT * step_mm)
    return Estimate.of(profile.x_mm[at] + part * step_mm, sigma_mm)


_DRAWS, _SEED = 200, 5
"""Of profiles: σ to 5 %."""


class ChosenHeights(NamedTuple):
    """Variances of sums over the teat by the noise in where it begins and ends.

    Attributes:
        mean_kpa2: of the mean compression; `load_n2`: of the load; `end_kpa2`: of the compression at its end.
    """

    mean_kpa2: float
    load_n2: float
    end_kpa2: float

    @classmethod
    def of(cls, closed: LoadProfile, heights: TeatHeights) -> "ChosenHeights":
        """Draws of the noise: sums over heights chosen anew, less those over the heights that were chosen."""
        if closed.noise is None:
            return cls(0.0, 0.0, 0.0)
        covariance, count = closed.noise.covariance, len(closed.x_mm)
        values, vectors = np.linalg.eigh(covariance)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        noise = np.random.default_rng(_SEED).normal(size=(_DRAWS, 3 * count)) @ root.T
        pairs = []
        for compression, load, gap in noise.reshape(_DRAWS, 3, count):
            drawn = closed.moved(compression, load, gap)
            try:
                pairs.append((_three(drawn, teat_heights(drawn)), _three(drawn, heights)))
            except AnalysisError:  # too little is pressed: such noise would have said so
                continue
        anew, same = np.array(pairs).reshape(-1, 2, 3).transpose(1, 0, 2)
        known = np.isfinite(anew)
        more = [
            float(np.var(anew[use, k]) - np.var(same[use, k])) if use.sum() > 1 else 0.0
            for k, use in enumerate(known.T)
        ]
        return cls(*(max(one, 0.0) for one in more))


def _three(profile: LoadProfile, heights: TeatHeights) -> tuple[float, float, float]:
    """Mean compression, load, and compression at the teat's end; NaN without one."""
    over = profile.spans_within(heights.first_mm, heights.last_mm)
    kpa = profile.compression_kpa.value
    at_end = np.nan
    if heights.end_mm is not None:
        last = profile.spans_within(*heights.last_of_teat_mm)
        at_end = float(kpa @ last / last.sum())
    return float(kpa @ over / over.sum()), float(profile.load_n_per_mm.value @ over), at_end
