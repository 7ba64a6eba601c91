"""The targets on the wall: their places on its outer face, with derivatives by the wall, and the sights of
them, places along given directions with covariance.

A target that one view alone sees has no point, but it lies on its ray: two of its three coordinates are as
good as a point's.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.linalg import block_diag

from grabberd.core.arrays import Array, Indices
from grabberd.core.geometry import Rig, linearise, rays
from grabberd.core.reconstruction import SingleViewImages
from grabberd_liner.analysis.wall.half_tube import HalfTube, MountedTube
from grabberd_liner.analysis.wall.rubber import RubberWall
from grabberd_liner.analysis.wall.shell import Geometry

_SMALL = 1e-4
"""Step of a logarithm: its square is far below what a place rounds to."""


class Targets(NamedTuple):
    """Material points at which T targets are glued.

    Attributes:
        s_mm: (T,) on the mounted wall's middle, round it; `x_mm`: (T,) along it.
        thickness_mm: of a target, whose face is what is seen.
    """

    s_mm: Array
    x_mm: Array
    thickness_mm: float = 0.0


class TargetPlaces:
    """Places of the targets on a wall.

    Attributes:
        basis: splines at the targets.
    """

    def __init__(self, half: HalfTube, targets: Targets) -> None:
        """Finds the targets on the wall's mesh."""
        self.basis = half.grid.basis(targets.s_mm, targets.x_mm)
        self._thickness_mm = targets.thickness_mm

    def places_mm(self, half: HalfTube, control: Array, tube: MountedTube | None = None) -> Array:
        """(T, 3) targets of a wall with control values (K, 4), of the half's tube or of another one."""
        wall = half.wall(self.basis, tube or half.tube)
        return self._seen(control, Geometry.of(self.basis, control), wall)

    def by_control(self, half: HalfTube, control: Array) -> sparse.csr_matrix:
        """(3 T, 4 K) derivatives of the targets by the control values."""
        geometry, wall = Geometry.of(self.basis, control), half.wall(self.basis, half.tube)
        return self.basis.by_control(_seen_by_values(geometry, wall, self._thickness_mm))

    def by_thickness(self, half: HalfTube, control: Array) -> Array:
        """(3 T,) derivatives by ln t alone, of a wall whose middle stays where it is."""
        geometry = Geometry.of(self.basis, control)
        tubes = half.tube, half.tube.changed(0.0, _SMALL, 0.0)
        before, after = (self._seen(control, geometry, half.wall(self.basis, tube)) for tube in tubes)
        return (after - before).ravel() / _SMALL

    def _seen(self, control: Array, geometry: Geometry, wall: RubberWall) -> Array:
        height = wall.layer(geometry.forms(), 0.5).depth_mm + self._thickness_mm
        return self.basis.of(control)[:, :3] + height[:, np.newaxis] * geometry.director()


def _seen_by_values(geometry: Geometry, wall: RubberWall, thickness_mm: float) -> Array:
    """(T, 3, 6, 4) derivatives of the targets by the six derivatives of x, y, z, s."""
    layer = wall.layer(geometry.forms(), 0.5)
    depth = (layer.depth_mm + thickness_mm)[:, np.newaxis, np.newaxis]
    by_depth = np.einsum("en,endc->ndc", layer.by_forms, geometry.forms_by_values())
    by = np.zeros((len(layer.depth_mm), 3, 6, 4))
    by[:, :, 1:] = np.einsum("ndc,ni->nidc", by_depth, geometry.director())
    by[:, :, 1:3, :3] += depth[..., np.newaxis] * geometry.normal_by_tangents()
    by[:, :, 1:3, 3] += depth * geometry.dual.transpose(1, 2, 0)
    by[:, np.arange(3), 0, np.arange(3)] += 1.0
    return by


_OF_A_POINT = 3


@dataclass(frozen=True, slots=True, eq=False)
class Sights:
    """M measured components of T targets' places.

    A triangulated target gives three, along x, y and z; one that a single view sees gives two, which are that
    view's image places made linear about a place near the target.

    Attributes:
        target: (M,) which target each is of.
        direction: (M, 3) gradient of the component by the target's place.
        value: (M,) measured component: direction · place.
        covariance: (M, M) of the values.
    """

    target: Indices
    direction: Array
    value: Array
    covariance: Array

    @classmethod
    def of_points(cls, points_mm: Array, covariances_mm2: Array) -> "Sights":
        """Sights of targets as triangulated.

        Args:
            points_mm: (T, 3) places; a row that is not finite was not seen.
            covariances_mm2: (T, 3, 3) of each place by itself.
        """
        seen = np.flatnonzero(np.isfinite(points_mm).all(axis=1))
        total = np.zeros((len(seen), 3, len(seen), 3))
        total[np.arange(len(seen)), :, np.arange(len(seen))] = covariances_mm2[seen]
        directions = np.tile(np.eye(3), (len(seen), 1))
        covariance = total.reshape(3 * len(seen), -1)
        return cls(np.repeat(seen, 3), directions, points_mm[seen].ravel(), covariance)

    def joined(self, other: "Sights") -> "Sights":
        """These sights and others that are independent of them."""
        return Sights(
            np.concatenate([self.target, other.target]),
            np.concatenate([self.direction, other.direction]),
            np.concatenate([self.value, other.value]),
            block_diag(self.covariance, other.covariance),
        )

    def shared(self, places_mm2: Array) -> "Sights":
        """The sights with a covariance (3 T, 3 T) of the places that all of a capture's share added."""
        return replace(self, covariance=self.covariance + self.of_places(self.of_places(places_mm2).T))

    def of_both_views(self) -> "Sights":
        """The sights of targets that were triangulated."""
        chosen = np.flatnonzero(np.bincount(self.target)[self.target] == _OF_A_POINT)
        return Sights(
            self.target[chosen],
            self.direction[chosen],
            self.value[chosen],
            self.covariance[np.ix_(chosen, chosen)],
        )

    def __len__(self) -> int:
        return len(self.target)

    def without(self, target: int) -> "Sights":
        """The sights of the other targets."""
        kept = self.target != target
        return Sights(
            self.target[kept], self.direction[kept], self.value[kept], self.covariance[np.ix_(kept, kept)]
        )

    def unit_variance(self) -> Array:
        """(M,) variance of each component where every place has one of 1 mm² in all directions."""
        return np.einsum("mi,mi->m", self.direction, self.direction)

    def of_places(self, columns: Array) -> Array:
        """(N, M) products of rows with T targets' places (N, 3 T) with the sights' directions; a copy."""
        axis = np.abs(self.direction).argmax(axis=1)
        picked = columns.take(_OF_A_POINT * self.target + axis, axis=1)
        # Along the axes, as most are, they only have to be picked.
        slanted = np.flatnonzero(
            (np.count_nonzero(self.direction, axis=1) > 1) | (self.direction.max(axis=1) != 1.0)
        )
        first = _OF_A_POINT * self.target[slanted]
        parts = (columns.take(first + k, axis=1) * self.direction[slanted, k] for k in range(_OF_A_POINT))
        if len(slanted):
            picked[:, slanted] = sum(parts)
        return picked

    def directions(self, targets: int) -> sparse.csr_matrix:
        """(M, 3 T) the sights as combinations of all T targets' places."""
        columns = 3 * self.target[:, np.newaxis] + np.arange(3)
        starts = 3 * np.arange(len(self) + 1)
        return sparse.csr_matrix(
            (self.direction.ravel(), columns.ravel(), starts), shape=(len(self), 3 * targets)
        )


_ROUNDS = 8
"""Of Newton's method towards the wall: from a nominal place the third is exact to a micrometre."""


class SightLines(NamedTuple):
    """N rays.

    Attributes:
        target: (N,) indices into the grid of the targets that lie on them.
        near_mm: (N, 3) point of each ray nearest to the target's nominal place.
        direction: (N, 3) unit vectors away from the camera.
        across: (N, 2, 3) unit vectors in which a place moves the image in x and in y; across the ray.
        sigma_mm: (N, 2) of the place along them.
    """

    target: Indices
    near_mm: Array
    direction: Array
    across: Array
    sigma_mm: Array

    @classmethod
    def of(
        cls,
        rig: Rig,
        images: SingleViewImages,
        target: Indices,
        nominal_mm: Array,
        origin_mm: Array,
        axes: Array,
    ) -> "SightLines":
        """Rays of images.

        Args:
            rig: with the views that saw them.
            images: of N targets in one field.
            target: (N,) indices of these into the grid.
            nominal_mm: (N, 3) their nominal places in the object's frame.
            origin_mm: (3,) origin of the liner's frame.
            axes: (3, 3) its axes as rows.
        """
        near, direction = np.empty((2, len(images), 3))
        slopes = np.empty((len(images), 2, 3))
        for index, view in enumerate(rig.views):
            own = images.view == index
            center_mm, direction[own] = rays(view, images.image_px[own])
            along = ((nominal_mm[own] - center_mm) * direction[own]).sum(axis=1, keepdims=True)
            near[own] = center_mm + along * direction[own]
            slopes[own] = linearise(rig, near[own])[1][:, index].transpose(2, 0, 1)
        px_per_mm = np.linalg.norm(slopes, axis=2)
        across = slopes / px_per_mm[..., np.newaxis] @ axes.T
        sigma_mm = images.sigma_px / px_per_mm
        return cls(target, (near - origin_mm) @ axes.T, direction @ axes.T, across, sigma_mm)

    def sights(self) -> Sights:
        """The place of each along both directions across its ray."""
        return Sights(
            np.repeat(self.target, 2),
            self.across.reshape(-1, 3),
            np.einsum("nki,ni->nk", self.across, self.near_mm).ravel(),
            np.diag(self.sigma_mm.ravel() ** 2),
        )

    def on_wall(self, radius_mm: Callable[[Array], Array], taper: float) -> Array:
        """(N, 3) places where the rays meet the side of a wall that faces the cameras.

        Args:
            radius_mm: distance of the wall from its axis at places (N, 3).
            taper: growth of that distance per length towards low x.
        """
        places = self.near_mm
        for _ in range(_ROUNDS):
            outside = np.hypot(places[:, 1], places[:, 2]) - radius_mm(places)
            steepness = (self.direction * _normal(places, taper)).sum(axis=1)
            places = places - (outside / steepness)[:, np.newaxis] * self.direction
        return places

    def lean(self, places_mm: Array, taper: float) -> Array:
        """(N, 3) movement of those places with the wall's distance from its axis: along the ray."""
        steepness = (self.direction * _normal(places_mm, taper)).sum(axis=1, keepdims=True)
        return self.direction / steepness

    def covariance_mm2(self, places_mm: Array, taper: float) -> Array:
        """(N, 3, 3) covariance of those places from the images' σ, on a wall that is where it is."""
        across = np.linalg.pinv(self.across)
        # What an image moves across the ray moves the place on along the wall.
        along = self.lean(places_mm, taper)[:, :, np.newaxis] * _normal(places_mm, taper)[:, np.newaxis]
        by_image = (np.eye(3) - along) @ across * self.sigma_mm[:, np.newaxis]
        return by_image @ by_image.swapaxes(1, 2)


def _normal(places_mm: Array, taper: float) -> Array:
    """(N, 3) derivative of the distance outside a cone by the place."""
    _, y, z = places_mm.T
    radius = np.hypot(y, z)
    return np.stack([np.full_like(y, taper), y / radius, z / radius], axis=1)
