"""The load over height: how hard the half of the wall that faces the cameras presses, section by section.

Pressure at a place is known to a few kPa; its sums over an arc are known several times as well, because what
one place has too much its neighbour has too little. So the sums are taken with the whole covariance.
"""

from typing import NamedTuple

import numpy as np

from grabberd_liner.analysis.estimate import Estimate, Joint
from grabberd_liner.analysis.gauss import gauss_rule
from grabberd_liner.analysis.load.load_fit import Followers, Posterior
from grabberd_liner.analysis.load.wall_model import WallModel
from grabberd_liner.analysis.wall.shell import Geometry, inner_area
from grabberd_liner.arrays import Array

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
        self._gaps: list[Followers] = []
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
        gap = next((one for one in self._gaps if one.response is found.response), None)
        if gap is None:
            by_values = np.zeros((len(self._x_mm), 1, *_BY_VALUES))
            by_values[:, 0, 0, _HEIGHT] = 2.0
            by_control = self._crest.by_control(by_values)
            gap = found.response.followers(found.model.followed(found.linear, by_control))
        self._gaps = [*[one for one in self._gaps if one is not gap][-1:], gap]
        count = len(self._x_mm)
        order = np.r_[0 : 2 * count : 2, 1 : 2 * count : 2, 2 * count : 3 * count]
        parts = found.noise_of_sums(self._basis, weights, gap, reference_mm2)
        return Noise(*(one[np.ix_(order, order)] for one in parts))


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
