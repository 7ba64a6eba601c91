"""The load over height: how hard the half of the wall that faces the cameras presses, section by section.

Pressure at a place is known to a few kPa; its sums over an arc are known several times as well, because
what one place has too much its neighbour has too little. So the sums are taken with the whole covariance.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.analysis.estimate import Estimate, Joint
from grabberd.analysis.gauss import gauss_rule
from grabberd.analysis.load.load_fit import Posterior
from grabberd.analysis.load.wall_model import WallModel
from grabberd.analysis.wall.shell import Geometry, inner_area

Array = NDArray[np.float64]

SPACING_MM = 3.25
"""Of the heights: half the usual pitch of targets; the prior lets the load change over 4.5 mm."""
_SEEN_POINTS, _FLANK_POINTS = 8, 5
"""Of Gauss's quadrature over the compression's arc, and over each flank.

Twice as many change compression and load by less than 1 %.
"""
_N_PER_KPA_MM2 = 1e-3


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
    """

    x_mm: Array
    compression_kpa: Joint
    load_n_per_mm: Joint
    length: Array
    gap_mm: Estimate

    @property
    def spans_mm(self) -> Array:
        """(H,) present length of the tube that each height stands for, up to halfway to its neighbours."""
        borders = np.concatenate([self.x_mm[:1], (self.x_mm[1:] + self.x_mm[:-1]) / 2, self.x_mm[-1:]])
        spans: Array = np.diff(borders) * self.length
        return spans


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
        # Beside them the crest, where the gap is read: one geometry serves both.
        self._with_crest = grid.basis(
            np.concatenate([np.tile(s_mm, heights), np.zeros(heights)]),
            np.concatenate([np.repeat(x_mm, len(s_mm)), x_mm]),
        )

    def profile(self, found: Posterior) -> LoadProfile:
        """The load over height in one state of the wall."""
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
        sums = found.contact_sums(self._basis, np.stack([mean, force], axis=1))
        compression, load = (_part(sums, slice(start, None, 2)) for start in (0, 1))
        inner_mm = self._with_crest.of(control[:, 2]) + depth_mm * geometry.director()[:, 2]
        relative = float(np.sqrt(found.tube_values()[1][1, 1]))
        # The targets are on the outer face, so the inner one is off by the whole error of the thickness.
        gap_mm = Estimate(2 * inner_mm[sections.stop :], np.full(count, 2 * tube.thickness_mm * relative))
        return LoadProfile(self._x_mm, compression, load, length, gap_mm)


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
