"""Rays of targets that one view alone sees, in the liner's frame.

Such a target has no point, but it lies on its ray: two of its three coordinates are as good as a point's.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.geometry import Rig, linearise, rays
from grabberd.core.reconstruction import SingleViewImages
from grabberd_liner.analysis.load.mounted.sights import Sights

Array = NDArray[np.float64]

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

    target: NDArray[np.intp]
    near_mm: Array
    direction: Array
    across: Array
    sigma_mm: Array

    @classmethod
    def of(
        cls,
        rig: Rig,
        images: SingleViewImages,
        target: NDArray[np.intp],
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
        lean: Array = self.direction / steepness
        return lean

    def covariance_mm2(self, places_mm: Array, taper: float) -> Array:
        """(N, 3, 3) covariance of those places from the images' σ, on a wall that is where it is."""
        across = np.linalg.pinv(self.across)
        # What an image moves across the ray moves the place on along the wall.
        along = self.lean(places_mm, taper)[:, :, np.newaxis] * _normal(places_mm, taper)[:, np.newaxis]
        by_image = (np.eye(3) - along) @ across * self.sigma_mm[:, np.newaxis]
        covariance: Array = by_image @ by_image.swapaxes(1, 2)
        return covariance


def _normal(places_mm: Array, taper: float) -> Array:
    """(N, 3) derivative of the distance outside a cone by the place."""
    _, y, z = places_mm.T
    radius = np.hypot(y, z)
    return np.stack([np.full_like(y, taper), y / radius, z / radius], axis=1)
