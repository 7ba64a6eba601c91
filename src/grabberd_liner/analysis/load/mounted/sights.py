"""Sights of the targets: their places along given directions, with covariance."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import block_diag

Array = NDArray[np.float64]

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

    target: NDArray[np.intp]
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
        variance: Array = np.einsum("mi,mi->m", self.direction, self.direction)
        return variance

    def of_places(self, columns: Array) -> Array:
        """(N, M) products of rows with T targets' places (N, 3 T) with the sights' directions; a copy."""
        axis = np.abs(self.direction).argmax(axis=1)
        # Along the axes, as where both views see all of a field's targets, they only have to be picked.
        if np.count_nonzero(self.direction) == len(self) and (self.direction.max(axis=1) == 1.0).all():
            picked: Array = columns.take(_OF_A_POINT * self.target + axis, axis=1)
            return picked
        products: Array = columns @ self.directions(columns.shape[1] // _OF_A_POINT).T
        return products

    def directions(self, targets: int) -> sparse.csr_matrix:
        """(M, 3 T) the sights as combinations of all T targets' places."""
        columns = 3 * self.target[:, np.newaxis] + np.arange(3)
        starts = 3 * np.arange(len(self) + 1)
        return sparse.csr_matrix(
            (self.direction.ravel(), columns.ravel(), starts), shape=(len(self), 3 * targets)
        )
