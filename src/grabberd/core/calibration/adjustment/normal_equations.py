"""Normal equations of a network, with the targets' positions eliminated (Schur complement).

Rank check: whether a network determines its unknowns, and if not, which of them it confounds.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Mask
from grabberd.core.calibration.adjustment.network import Network, Unknowns
from grabberd.core.geometry import (
    PARAMETERS,
    Rig,
    View,
    linearise,
    linearise_corrections,
    linearise_parameters,
)
from grabberd.core.reconstruction.points import DIAGONAL, FIRST, SECOND, inverse_symmetric
from grabberd.errors import MeasurementError, RankDeficient

_CENTER = slice(PARAMETERS.index("X0_mm"), PARAMETERS.index("Z0_mm") + 1)
# A symmetric 3x3 matrix is kept as its six elements 00 01 02 11 12 22.


class State(NamedTuple):
    """Values of all unknowns: the views, and the targets' positions (T, 3) in mm."""

    views: tuple[View, ...]
    xyz_mm: Array


class Linear(NamedTuple):
    """Network linearised at a state; everything is whitened, and zero where a target was not seen.

    Attributes:
        image: (2, V, T) misclosures of the image points; NaN behind a camera.
        offset: (3, P) misclosures of the free positions.
        slopes: (2, V, 18, T) derivatives of the image points by the parameters of their view.
        blocks: (V, 18, U) derivatives of the parameters by the unknowns.
        omega: Sum of the squared misclosures; infinite if one is NaN.
    """

    image: Array
    offset: Array
    slopes: Array
    blocks: Array
    omega: float


class Normals(NamedTuple):
    """Normal equations of U parameters and P positions.

    Attributes:
        matrix: (U, U) block of the parameters.
        right: (U,) its right side.
        own: (6, P) block of each position, as its upper triangle.
        own_right: (3, P) its right side.
        cross: (3, P, U) blocks of positions and parameters.
    """

    matrix: Array
    right: Array
    own: Array
    own_right: Array
    cross: Array


class Reduced(NamedTuple):
    """Normal equations after eliminating the positions.

    Attributes:
        matrix: (U, U).
        right: (U,).
        inverse: (3, 3, P) own⁻¹ of each position.
        coupling: (3, P, U) own⁻¹·cross: minus the derivative of a position by the parameters.
    """

    matrix: Array
    right: Array
    inverse: Array
    coupling: Array


class Problem:
    """Network laid out with one column per target in every view; targets a view does not see have weight 0.

    Attributes:
        network: The input.
        unknowns: The parameters to estimate.
        moving: (P,) intp, targets whose position is free: not held, and seen at all.
        loose: (3, P) bool, their coordinates that are not held.
        prior: (3, P) 1/σ, 0 if unknown.
        freedom: Degrees of freedom.
    """

    def __init__(self, network: Network, unknowns: Unknowns) -> None:
        self.network = network
        self.unknowns = unknowns
        shape = (2, len(network.views), len(network.target_mm))
        self._observed, self._weight = np.zeros(shape), np.zeros(shape)
        place = (slice(None), network.view, network.target)
        self._observed[place], self._weight[place] = network.xy_px.T, 1.0 / network.sigma_px.T
        # Held during the iteration: they hardly depend on any unknown, and have no place in its slopes.
        rig, xyz_mm = Rig.of_views(network.views), network.target_mm
        self._observed -= network.offsets_px(rig, xyz_mm, linearise(rig, xyz_mm)[1])
        self._unseen: Mask | None = None if self._weight.all() else self._weight == 0
        self.moving = np.flatnonzero((network.target_sigma_mm > 0).any(axis=1) & (network.sightings > 0))
        sigma = network.target_sigma_mm[self.moving].T
        self.loose: Mask = sigma > 0
        self.prior = np.divide(1.0, sigma, out=np.zeros_like(sigma), where=self.loose)
        self._own_prior = np.where(self.loose, self.prior**2, 1.0)
        self.freedom = 2 * len(network) - len(unknowns) - int(np.isinf(sigma).sum())

    def check(self) -> None:
        """Check that there are enough observations.

        Raises:
            MeasurementError: There are fewer than unknowns, or targets are seen too rarely.
        """
        self.check_places()
        if self.freedom < 1:
            raise MeasurementError(
                f"{len(self.network)} image points do not determine {len(self.unknowns)} parameters",
                "make more targets visible, or hold more parameters",
            )

    def check_places(self) -> None:
        """Check that every target seen was seen in enough views.

        Raises:
            MeasurementError: Some were not; the message names them.
        """
        if rare := np.flatnonzero(self.network.undetermined).tolist():
            ids = ", ".join(str(self.network.id_of(one)) for one in rare)
            raise MeasurementError(
                f"targets {ids} have too few image points for their unknown positions",
                "leave out targets seen by a single view, or give their positions with a standard deviation",
            )

    @property
    def start(self) -> State:
        """Start values; parameters that share an unknown start from their mean."""
        unknowns, views = self.unknowns, self.network.views
        return State(unknowns.with_values(views, unknowns.values(views)), self.network.target_mm)

    def moved(self, state: State, step: Array, places: Array) -> State:
        """Apply a step (U,) of the unknowns and (3, P) of the positions."""
        views = self.unknowns.moved(state.views, step)
        if not len(self.moving):
            return State(views, state.xyz_mm)
        xyz = state.xyz_mm.copy()
        xyz[self.moving] += np.where(self.loose, places, 0.0).T
        return State(views, xyz)

    def at(self, state: State) -> Linear:
        """Linearise the network at a state."""
        rig = Rig.of_views(state.views)
        if self.network.among_corrected:
            excess, slopes = linearise_corrections(rig, state.xyz_mm, self._observed)
        else:
            computed, slopes = linearise_parameters(rig, state.xyz_mm)
            excess = computed - self._observed
        image = -excess * self._weight
        slopes *= self._weight[:, :, np.newaxis]
        if self._unseen is not None:
            # Zero weight leaves NaN as it is, and an unseen target may lie behind the camera.
            image[self._unseen] = 0.0
            slopes.swapaxes(2, 3)[self._unseen] = 0.0
        offset = (self.network.target_mm - state.xyz_mm)[self.moving].T * self.prior
        omega = float(np.vdot(image, image) + np.vdot(offset, offset))
        blocks = self.unknowns.derivatives(state.views).reshape(len(state.views), len(PARAMETERS), -1)
        return Linear(image, offset, slopes, blocks, omega if np.isfinite(omega) else np.inf)

    def normals(self, linear: Linear) -> Normals:
        """Form the normal equations of a linearised network."""
        matrix, right = self._of_parameters(linear)
        if not len(self.moving):
            nothing = np.empty((6, 0))
            return Normals(matrix, right, nothing, nothing[:3], np.empty((3, 0, len(right))))
        places = self.by_place(linear)
        own = (places[:, :, FIRST] * places[:, :, SECOND]).sum(axis=(0, 1))
        own[DIAGONAL, :] += self._own_prior
        own_right = (places * linear.image[:, :, np.newaxis, self.moving]).sum(axis=(0, 1))
        own_right += linear.offset * self.prior
        return Normals(matrix, right, own, own_right, self._cross(places, linear))

    def by_place(self, linear: Linear) -> Array:
        """(2, V, 3, P) whitened slopes by the positions: minus those by the projection centre."""
        return -linear.slopes[:, :, _CENTER][..., self.moving] * self.loose

    def whitened_rows(self, linear: Linear) -> Array:
        """(2, V, T, U) whitened slopes of the image points by the unknowns."""
        return linear.slopes.swapaxes(2, 3) @ linear.blocks

    def residuals_px(self, linear: Linear) -> Array:
        """(M, 2) misclosures of the image points in px."""
        network = self.network
        return linear.image[:, network.view, network.target].T * network.sigma_px

    def _of_parameters(self, linear: Linear) -> tuple[Array, Array]:
        """Parameter block: one block per view, since views share no slopes, folded onto the unknowns."""
        slopes, folding = linear.slopes, linear.blocks.swapaxes(1, 2)
        matrix = folding @ (slopes @ slopes.swapaxes(2, 3)).sum(axis=0) @ linear.blocks
        right = folding @ (slopes @ linear.image[..., np.newaxis]).sum(axis=0)
        return matrix.sum(axis=0), right.sum(axis=0)[:, 0]

    def _cross(self, places: Array, linear: Linear) -> Array:
        slopes = linear.slopes
        _, views, parameters, _ = slopes.shape
        moving = len(self.moving)
        products = places[:, :, :, np.newaxis] * slopes[:, :, np.newaxis][..., self.moving]
        flat = products.sum(axis=0).transpose(1, 3, 0, 2).reshape(3 * moving, views * parameters)
        return (flat @ linear.blocks.reshape(views * parameters, -1)).reshape(3, moving, -1)


def reduced(normals: Normals, damping: float = 0.0) -> Reduced:
    """Eliminate the positions; `damping` is Marquardt's on their own diagonals."""
    count, unknowns = normals.cross.shape[1:]
    if not count:
        return Reduced(normals.matrix, normals.right, np.empty((3, 3, 0)), normals.cross)
    own = normals.own.copy()
    own[DIAGONAL, :] *= 1.0 + damping
    inverse = inverse_symmetric(own)
    coupling = np.einsum("klp,lpu->kpu", inverse, normals.cross)
    flat = coupling.reshape(3 * count, unknowns)
    matrix = normals.matrix - normals.cross.reshape(3 * count, unknowns).T @ flat
    right = normals.right - normals.own_right.reshape(3 * count) @ flat
    return Reduced(matrix, right, inverse, coupling)


THRESHOLD = 1e-4
"""Singular values below this share of the largest count as zero; good calibration frames have 2e-4 or
more."""
LEAST_DEPTH = 0.02
"""Least depth of the targets, as a share of their largest extent."""
_INTERIOR, _POSE = PARAMETERS[:3], PARAMETERS[3:9]
_NAMED = 0.1
"""Share in a null vector from which a parameter is named."""


@dataclass(frozen=True, slots=True)
class NullVector:
    """Combined change of several parameters that the image points do not show.

    Attributes:
        parameters: Names of the parameters involved, the greatest share first.
        shares: Their components in the unit vector, each parameter in units of its own effect.
    """

    parameters: tuple[str, ...]
    shares: tuple[float, ...]

    def __str__(self) -> str:
        return " + ".join(
            f"{share:.2f} {name}" for name, share in zip(self.parameters, self.shares, strict=True)
        )


def check_rank(network: Network, unknowns: Unknowns) -> None:
    """Check that a network determines its unknowns, before it is adjusted.

    The Jacobian is judged with equal weights and known positions held, because the geometry is in question,
    and without distortion: with it, a planar frame's smallest singular value is no longer zero, though no
    more can be learned from it. So the targets' depth is also tested directly, for all views whose focal
    length or principal point is free.

    Raises:
        RankDeficient: It does not; the message names the parameters of every null vector.
        MeasurementError: There are too few observations, or the start lies behind a camera.
    """
    flat = replace(
        network,
        views=tuple(replace(view, b=(0.0,) * 9) for view in network.views),
        sigma_px=np.full_like(network.sigma_px, np.sqrt(np.mean(network.sigma_px**2))),
        target_sigma_mm=np.where(np.isfinite(network.target_sigma_mm), 0.0, np.inf),
    )
    problem = Problem(flat, unknowns)
    problem.check()
    linear = problem.at(problem.start)
    if not np.isfinite(linear.omega):
        raise MeasurementError(
            "a target lies behind a camera where the adjustment would start",
            "check the rig's nominal geometry and the calibration frame's file",
        )
    normals = problem.normals(linear)
    nulls = null_vectors(reduced(normals).matrix, np.diag(normals.matrix), unknowns.names)
    if nulls:
        raise _deficient(nulls)
    _check_depth(network, unknowns)


def null_vectors(matrix: Array, diagonal: Array, names: Sequence[str]) -> tuple[NullVector, ...]:
    """Find what a normal matrix leaves undetermined, each parameter scaled to its own effect first.

    Args:
        matrix: (U, U) normal matrix, other unknowns eliminated.
        diagonal: (U,) squared lengths of the parameters' columns in the Jacobian.
        names: of the U parameters.
    """
    scale = 1.0 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    squares, vectors = np.linalg.eigh(matrix * scale * scale[:, np.newaxis])
    if not len(squares):
        return ()
    null = squares <= THRESHOLD**2 * max(squares[-1], 0.0)
    return tuple(_named(vector, names) for vector in _plain(vectors[:, null]).T)


def _plain(basis: Array) -> Array:
    """(U, K) another basis of the same space, whose vectors involve as few parameters as possible."""
    basis = basis.copy()
    for column in range(basis.shape[1]):
        row, other = divmod(int(np.abs(basis[:, column:]).argmax()), basis.shape[1] - column)
        basis[:, [column, column + other]] = basis[:, [column + other, column]]
        basis[:, column] /= basis[row, column]
        rest = np.arange(basis.shape[1]) != column
        basis[:, rest] -= np.outer(basis[:, column], basis[row, rest])
    return basis / np.sqrt((basis * basis).sum(axis=0))


def _named(vector: Array, names: Sequence[str]) -> NullVector:
    order = [index for index in np.argsort(-np.abs(vector)) if abs(vector[index]) >= _NAMED]
    return NullVector(tuple(names[i] for i in order), tuple(float(vector[i]) for i in order))


def _deficient(nulls: Sequence[NullVector]) -> RankDeficient:
    names = list(dict.fromkeys(name for vector in nulls for name in vector.parameters))
    return RankDeficient(
        f"the image points do not determine {', '.join(names)} apart from one another; they do not show "
        + "; nor ".join(str(vector) for vector in nulls),
        "hold some of these parameters, or use a calibration frame with more depth",
        names,
    )


def _check_depth(network: Network, unknowns: Unknowns) -> None:
    for index, view in enumerate(network.views):
        sought = [
            name for name, number in zip(PARAMETERS, unknowns.number[index], strict=True) if number >= 0
        ]
        names = [f"{view.name}.{name}" for name in sought if name in _INTERIOR + _POSE]
        if set(sought) & set(_INTERIOR):
            xyz_mm = network.target_mm[network.target[network.view == index]]
            check_depth(xyz_mm, names, f"the targets in view {view.name}")


def check_depth(places_mm: Array, names: Sequence[str], what: str) -> None:
    """Check that positions (N, 3) have the depth that an interior orientation needs.

    Args:
        places_mm: Positions of the targets.
        names: Names of the parameters that they are to determine.
        what: Description of the positions for the message.

    Raises:
        RankDeficient: They lie in a plane.
    """
    extents = np.linalg.svd(places_mm - places_mm.mean(axis=0), compute_uv=False)
    if extents[-1] < LEAST_DEPTH * extents[0]:
        raise RankDeficient(
            f"{what} lie in a plane (depth {extents[-1] / extents[0]:.1%} of their extent), which does not "
            f"determine {', '.join(names)} together",
            "use a calibration frame with depth (±8 mm is enough), or hold f_mm, x0_px and y0_px",
            names,
        )
