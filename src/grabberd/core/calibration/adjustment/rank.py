"""Rank check: whether a network determines its unknowns, and if not, which of them it confounds."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from grabberd.core.calibration.adjustment.network import Network, Unknowns
from grabberd.core.calibration.adjustment.normal_equations import Problem, reduced
from grabberd.core.geometry import PARAMETERS
from grabberd.errors import MeasurementError, RankDeficient

Array = NDArray[np.float64]

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
