"""The load over height: how hard the half of the wall that faces the cameras presses, section by section.

Pressure at a place is known to a few kPa; its sums over an arc are known several times as well, because what
one place has too much its neighbour has too little. So the sums are taken with the whole covariance.

The closed liner: its load over height, averaged over phase d, the heights at which it presses a teat, and
what noise in their choice adds to sums over them.

Where there is no teat, opposite walls meet and press each other as hard as they would press a teat. The two
differ in the gap between the walls.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Mask
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Estimate, Joint
from grabberd_liner.analysis.load.load_fit import Posterior, Response
from grabberd_liner.analysis.load.wall_model import WallModel
from grabberd_liner.analysis.wall.shell import Geometry, inner_area
from grabberd_liner.analysis.wall.splines import gauss_rule

SPACING_MM = 3.25
"""Of the heights: half the usual pitch of targets; the prior lets the load change over 4.5 mm."""
_SEEN_POINTS, _FLANK_POINTS = 8, 5
"""Of Gauss's quadrature over the compression's arc, and over each flank.

Twice as many change compression and load by less than 1 %.
"""
_N_PER_KPA_MM2 = 1e-3
_BY_VALUES, _HEIGHT = (6, 4), 2
"""Derivatives of a quantity by x, y, z and s and their derivatives along the wall; which is that by z."""


class Noise(NamedTuple):
    """Part of the covariance of a load over H heights that comes from the noise of what was seen.

    Of compression, load and gap, one after the other.

    Attributes:
        own: (3 H, 3 H) by the state's own points; `reference`: by the reference state's, which all states of
            a capture share.
    """

    own: Array
    reference: Array

    @property
    def covariance(self) -> Array:
        """(3 H, 3 H) of both."""
        return self.own + self.reference


class LoadProfile(NamedTuple):
    """The load over H heights, of the half of the wall that faces the cameras.

    A height stays with the material: a section keeps its own while the wall moves. The covariances are those
    of the contact pressure; the wall's shape, by comparison, is known exactly.

    Attributes:
        x_mm: (H,) heights on the mounted tube, ascending.
        compression_kpa: mean contact pressure over an arc about the line that faces the cameras.
        load_n_per_mm: force that presses the teat on this side, from cut to cut, per present length of tube.
        length: (H,) present length of the tube over its mounted one.
        gap_mm: (H,) between the inner faces of opposite walls, on the line that faces the cameras. The
            hidden half is taken for the seen one's mirror image; σ is that of the wall's thickness alone.
        noise: part of the covariances by the noise of what was seen; None if it was not asked for.
    """

    x_mm: Array
    compression_kpa: Joint
    load_n_per_mm: Joint
    length: Array
    gap_mm: Estimate
    noise: Noise | None = None

    @property
    def borders_mm(self) -> Array:
        """(H + 1,) on the mounted tube: each height stands for what is up to halfway to its neighbours."""
        return np.concatenate([self.x_mm[:1], (self.x_mm[1:] + self.x_mm[:-1]) / 2, self.x_mm[-1:]])

    def moved(self, compression_kpa: Array, load_n_per_mm: Array, gap_mm: Array) -> "LoadProfile":
        """The profile with something added to each height's values."""
        compression, load, gap = self.compression_kpa, self.load_n_per_mm, self.gap_mm
        return self._replace(
            compression_kpa=compression._replace(value=compression.value + compression_kpa),
            load_n_per_mm=load._replace(value=load.value + load_n_per_mm),
            gap_mm=gap._replace(value=gap.value + gap_mm),
        )

    def mixed(self, other: "LoadProfile", share: float) -> "LoadProfile":
        """Compression and load if the other profile's are right with a probability.

        Both are of the same points, so that their noise goes together.
        """
        noise = self.noise
        if noise is not None and other.noise is not None:
            parts = zip(noise, other.noise, strict=True)
            noise = Noise(*((1 - share) * own + share * others for own, others in parts))
        return self._replace(
            compression_kpa=self.compression_kpa.mixed(other.compression_kpa, share),
            load_n_per_mm=self.load_n_per_mm.mixed(other.load_n_per_mm, share),
            noise=noise,
        )

    def spans_within(self, first_mm: float, last_mm: float) -> Array:
        """(H,) present length that each height stands for in a stretch of the mounted tube; 0 outside it."""
        return np.diff(np.clip(self.borders_mm, first_mm, last_mm)) * self.length


def profile_heights(x_mm: Array) -> Array:
    """(H,) heights, nearly `SPACING_MM` apart, from the first of the targets' heights to the last."""
    first, last = float(x_mm.min()), float(x_mm.max())
    return np.linspace(first, last, 1 + max(1, round((last - first) / SPACING_MM)))


class Sections:
    """Sections of a wall whose load is asked for in state after state."""

    def __init__(self, model: WallModel, x_mm: Array, arc_mm: tuple[float, float]) -> None:
        """Lays out the points of quadrature.

        Args:
            model: the wall's.
            x_mm: (H,) heights on the mounted tube, in the liner's frame, ascending.
            arc_mm: ends of the compression's arc, from the line that faces the cameras, on the wall's middle.
        """
        end_mm = np.pi / 2 * model.half.tube.radius_mm
        s_mm, weights, seen = _rule((-end_mm, *arc_mm, end_mm))
        heights, grid = len(x_mm), model.half.grid
        self._x_mm, self._weights_mm, self._seen = x_mm, weights, seen
        self._basis = grid.basis(np.tile(s_mm, heights), np.repeat(x_mm, len(s_mm)))
        self._crest = grid.basis(np.zeros(heights), x_mm)
        # Beside them the crest, where the gap is read: one geometry serves both.
        self._with_crest = grid.basis(
            np.concatenate([np.tile(s_mm, heights), np.zeros(heights)]),
            np.concatenate([np.repeat(x_mm, len(s_mm)), x_mm]),
        )

    def profile(self, found: Posterior, reference_mm2: Array | None = None) -> LoadProfile:
        """The load over height in one state of the wall.

        Args:
            found: the wall.
            reference_mm2: covariance of the targets' places by the reference state, to have the part of the
                noise told apart; None to save its time.
        """
        control, count = found.control, len(self._x_mm)
        by_section = (count, len(self._weights_mm))
        geometry = Geometry.of(self._with_crest, control)
        forms, sections = geometry.forms(), slice(count * len(self._weights_mm))
        tube = found.model.tube(found.parameters)
        depth_mm = found.model.half.wall(self._with_crest, tube).layer(forms, -0.5).depth_mm
        length = geometry.tangents[1, sections, 0].reshape(by_section) @ self._weights_mm
        length = length / self._weights_mm.sum()
        # How much of the inner face looks along the view, by the area of the mounted wall's middle.
        facing = (geometry.area * inner_area(forms, depth_mm) * geometry.normal[:, 2])[sections]
        force = _N_PER_KPA_MM2 * self._weights_mm * facing.reshape(by_section) / length[:, np.newaxis]
        mean = np.broadcast_to(self._weights_mm * self._seen, by_section) / (self._weights_mm @ self._seen)
        weights = np.stack([mean, force], axis=1)
        sums = found.contact_sums(self._basis, weights)
        noise = None if reference_mm2 is None else self._noise(found, weights, reference_mm2)
        compression, load = (_part(sums, slice(start, None, 2)) for start in (0, 1))
        inner_mm = self._with_crest.of(control[:, 2]) + depth_mm * geometry.director()[:, 2]
        relative = float(np.sqrt(found.tube_values()[1][1, 1]))
        # The targets are on the outer face, so the inner one is off by the whole error of the thickness.
        gap_mm = Estimate(2 * inner_mm[sections.stop :], np.full(count, 2 * tube.thickness_mm * relative))
        return LoadProfile(self._x_mm, compression, load, length, gap_mm, noise)

    def _noise(self, found: Posterior, weights: Array, reference_mm2: Array) -> Noise:
        """Noise of the sums with these weights, and of the gap."""
        gap = found.response.kept_followers(self, self._gap_by_parameters)
        count = len(self._x_mm)
        order = np.r_[0 : 2 * count : 2, 1 : 2 * count : 2, 2 * count : 3 * count]
        parts = found.noise_of_sums(self._basis, weights, gap, reference_mm2)
        return Noise(*(one[np.ix_(order, order)] for one in parts))

    def _gap_by_parameters(self, response: Response) -> Array:
        """(H, P) derivatives of the gap at the state that was linearised."""
        by_values = np.zeros((len(self._x_mm), 1, *_BY_VALUES))
        by_values[:, 0, 0, _HEIGHT] = 2.0
        return response.model.followed(response.linear, self._crest.by_control(by_values))


def _rule(borders_mm: tuple[float, ...]) -> tuple[Array, Array, Array]:
    """Points of quadrature (S,) over three panels, their weights, and 1 for those in the middle one."""
    counts = (_FLANK_POINTS, _SEEN_POINTS, _FLANK_POINTS)
    rules = [gauss_rule(count) for count in counts]
    half = np.diff(borders_mm) / 2
    middle = np.array(borders_mm[:-1]) + half
    places = [m + h * local for (local, _), m, h in zip(rules, middle, half, strict=True)]
    weights = [h * weight for (_, weight), h in zip(rules, half, strict=True)]
    return np.concatenate(places), np.concatenate(weights), np.repeat([0.0, 1.0, 0.0], counts)


def _part(joint: Joint, part: slice) -> Joint:
    # Copied: a view would keep the covariance of both sums alive with every field's profile.
    return Joint(joint.value[part].copy(), joint.covariance[part, part].copy())


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


def held_apart_by_teat(profile: LoadProfile) -> tuple[float, float]:
    """Lowest and highest height that the teat holds apart, with what of its tip is beyond where it ends.

    Raises:
        AnalysisError: no teat is pressed.
    """
    teat, apart = teat_heights(profile).teat, _held_apart(profile)
    first, last = next(run for run in _runs(apart, ~apart) if teat[run[0] : run[1] + 1].any())
    return float(profile.x_mm[first]), float(profile.x_mm[last])


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
