"""The open wall as the reference state shows it, and where on it the targets are glued."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis.load.mounted.sight_lines import SightLines
from grabberd_liner.analysis.wall.half_tube import HalfTube, MountedTube

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_DEPARTURE_MM, _SMOOTH_MM = 0.2, 15.0
"""Departure of a mounted wall from a cone, and the length over which it changes."""
_UNSEEN_MM = 0.3
"""σ of a target's place in the face if the reference state does not show it: of glueing by hand."""


class Glued(NamedTuple):
    """N targets on the open wall.

    Attributes:
        places_mm: (N, 3) in the liner's frame; `covariance_mm2`: (3 N, 3 N).
    """

    places_mm: Array
    covariance_mm2: Array


class OpenWall(NamedTuple):
    """A cone and a smooth departure from it, as triangulated targets show it.

    Attributes:
        half: the mounted half tube with that departure; its taper is the cone's.
        face_mm: distance of the targets' faces from the axis, halfway along the cone.
        seen: (S,) indices of the triangulated targets; `places_mm`: (S, 3) and `covariance_mm2`: (S, 3, 3)
            in the liner's frame.
        departures: of the wall.
    """

    half: HalfTube
    face_mm: float
    seen: Indices
    places_mm: Array
    covariance_mm2: Array
    departures: "_Departures"

    @classmethod
    def of(
        cls,
        nominal_mm: Array,
        seen: Indices,
        places_mm: Array,
        covariance_mm2: Array,
        face_mm: float,
        tube: MountedTube,
    ) -> "OpenWall":
        """The wall under triangulated targets.

        Args:
            nominal_mm: (N, 3) nominal places of all targets in the liner's frame.
            seen: (S,) indices of those that were triangulated.
            places_mm: (S, 3) where they are.
            covariance_mm2: (S, 3, 3) of each.
            face_mm: distance of the targets' faces from the axis.
            tube: the ideal tube.
        """
        radial = _radial(places_mm)
        weight = 1 / np.einsum("ni,nij,nj->n", radial, covariance_mm2, radial)
        x_mm, away = places_mm[:, 0], np.hypot(places_mm[:, 1], places_mm[:, 2]) - face_mm
        taper = -float((weight * x_mm * away).sum() / (weight * x_mm**2).sum())
        tube = replace(tube, taper=taper)
        departures = _Departures.of(HalfTube(tube), places_mm, away + taper * x_mm, 1 / weight)
        half = HalfTube(tube, departures.control)
        return cls(half, face_mm, seen, places_mm, covariance_mm2, departures)

    def glued(self, nominal_mm: Array, lines: SightLines | None) -> Glued:
        """All targets: as triangulated, where a ray meets the wall, or else where they should be.

        Args:
            nominal_mm: (N, 3) nominal places in the liner's frame.
            lines: rays of targets that one view alone sees.
        """
        places = nominal_mm.copy()
        places[self.seen] = self.places_mm
        covariance = np.tile(_UNSEEN_MM**2 * np.eye(3), (len(places), 1, 1))
        covariance[self.seen] = self.covariance_mm2
        taper = self.half.tube.taper
        if lines is not None:
            met = lines.on_wall(self._radius_mm, taper)
            places[lines.target], covariance[lines.target] = met, lines.covariance_mm2(met, taper)
        # How each place moves with the wall's departure under it; within the face, each by itself.
        radial = _radial(places)
        lean, within = radial.copy(), np.eye(3) - radial[:, :, np.newaxis] * radial[:, np.newaxis]
        if lines is not None:
            lean[lines.target] = lines.lean(met, taper)
        departure = self.departures.covariance_mm2(places)
        shared = np.einsum("ni,nm,mj->nimj", lean, departure, lean)
        each = np.arange(len(places))
        shared[each, :, each] += within @ covariance @ within
        return Glued(places, shared.reshape(places.size, -1))

    def _radius_mm(self, places_mm: Array) -> Array:
        cone_mm = self.face_mm - self.half.tube.taper * places_mm[:, 0]
        radius: Array = cone_mm + self.departures.at(places_mm)
        return radius


class _Departures(NamedTuple):
    """Smooth radial departure of a mounted wall from a cone.

    Attributes:
        half: the cone.
        control: (K,) control values.
        seen: (S, K) splines at the targets that showed it; `seen_mm2`: (S, S) covariance of what they showed.
    """

    half: HalfTube
    control: Array
    seen: Array
    seen_mm2: Array

    @classmethod
    def of(cls, half: HalfTube, places_mm: Array, away_mm: Array, variance_mm2: Array) -> "_Departures":
        """The departure that targets (S, 3) show which are (S,) away from the cone."""
        at = _at(half, places_mm)
        spread = _spread(half, at)
        seen_mm2 = at @ spread + np.diag(variance_mm2)
        return cls(half, spread @ np.linalg.solve(seen_mm2, away_mm), at, seen_mm2)

    def at(self, places_mm: Array) -> Array:
        """(N,) departure at places (N, 3)."""
        departure: Array = _at(self.half, places_mm) @ self.control
        return departure

    def covariance_mm2(self, places_mm: Array) -> Array:
        """(N, N) covariance of the departure at places (N, 3)."""
        at = _at(self.half, places_mm)
        prior = _spread(self.half, at)
        cross = self.seen @ prior
        covariance: Array = at @ prior - cross.T @ np.linalg.solve(self.seen_mm2, cross)
        return covariance


def _at(half: HalfTube, places_mm: Array) -> Array:
    """(N, K) splines at places (N, 3)."""
    s_mm = half.tube.radius_mm * np.arctan2(places_mm[:, 1], places_mm[:, 2])
    return np.asarray(half.grid.basis(s_mm, places_mm[:, 0]).matrices[0].toarray(), np.float64)


def _spread(half: HalfTube, at: Array) -> Array:
    """(K, N) prior covariance of the control values and the departure at `at` (N, K)."""
    around, along = (
        np.exp(-0.5 * ((axis[:, np.newaxis] - axis) / _SMOOTH_MM) ** 2)
        for axis in (half.grid.around.greville, half.grid.along.greville)
    )
    spread: Array = _DEPARTURE_MM**2 * np.kron(along, around) @ at.T
    return spread


def _radial(places_mm: Array) -> Array:
    """(N, 3) unit vectors outward from the axis."""
    theta = np.arctan2(places_mm[:, 1], places_mm[:, 2])
    return np.stack([np.zeros_like(theta), np.sin(theta), np.cos(theta)], axis=1)
