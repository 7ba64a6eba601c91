"""Starting values of a network: every view's pose by resection, every unknown position by intersection.

Views that see enough known targets come first; the targets that they determine together help to find the next
ones. The interior orientation is taken as given, roughly. Three points have up to four poses in closed form:
Grunert's solution in the form of R. M. Haralick et al., "Review and analysis of solutions of the three point
perspective pose estimation problem", Int. J. Computer Vision 13 (1994) 331–356, equations (9) to (11).

Transfer of a calibration to a glass plate inserted since.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from grabberd.core.arrays import Array, Mask
from grabberd.core.calibration.adjustment.adjustment import Adjustment, adjust
from grabberd.core.calibration.adjustment.network import Network, Unknowns
from grabberd.core.geometry import (
    PARAMETERS,
    Calibration,
    Plate,
    Rig,
    View,
    correct_all,
    parameter_derivatives,
    project,
    project_through,
    rays,
)
from grabberd.errors import MeasurementError

_REAL = 1e-3
"""Imaginary part below which a root counts as real: double roots come out as pairs that are nearly real."""


def poses_of_three(directions: Array, xyz_mm: Array) -> Iterator[tuple[Array, Array]]:
    """Find all poses in which three points are seen in given directions.

    Args:
        directions: (3, 3) unit vectors in the camera's frame, one a row.
        xyz_mm: (3, 3) the points in the object's frame, one a row, not on a line.

    Yields:
        A proper rotation (3, 3) from the object's frame into the camera's, and the projection centre (3,).
    """
    for reach in _distances(directions, xyz_mm):
        if (reach > 0).all():
            yield _pose(directions * reach[:, np.newaxis], xyz_mm)


def _distances(directions: Array, xyz_mm: Array) -> Iterator[Array]:
    """(3,) distances of the points from the projection centre."""
    a2, b2, c2 = (float(((xyz_mm[i] - xyz_mm[k]) ** 2).sum()) for i, k in ((1, 2), (0, 2), (0, 1)))
    alpha, beta, gamma = (float(directions[i] @ directions[k]) for i, k in ((1, 2), (0, 2), (0, 1)))
    less, more = (a2 - c2) / b2, (a2 + c2) / b2
    quartic = [
        (less - 1) ** 2 - 4 * c2 / b2 * alpha**2,
        4 * (less * (1 - less) * beta - (1 - more) * alpha * gamma + 2 * c2 / b2 * alpha**2 * beta),
        2 * (less**2 - 1 + 2 * less**2 * beta**2 + 2 * (b2 - c2) / b2 * alpha**2)
        + 2 * (-4 * more * alpha * beta * gamma + 2 * (b2 - a2) / b2 * gamma**2),
        4 * (-less * (1 + less) * beta + 2 * a2 / b2 * gamma**2 * beta - (1 - more) * alpha * gamma),
        (1 + less) ** 2 - 4 * a2 / b2 * gamma**2,
    ]
    for root in np.roots(quartic):
        v, below = float(root.real), 2 * (gamma - float(root.real) * alpha)
        if abs(root.imag) > _REAL * max(1.0, abs(v)) or v <= 0 or below == 0:
            continue
        u = ((less - 1) * v * v - 2 * less * beta * v + 1 + less) / below
        yield np.sqrt(b2 / (1 + v * v - 2 * v * beta)) * np.array([1.0, u, v])


def _pose(camera_mm: Array, xyz_mm: Array) -> tuple[Array, Array]:
    """Rigid motion from the object's frame into the camera's, after Kabsch."""
    middle, seen = xyz_mm.mean(axis=0), camera_mm.mean(axis=0)
    left, _, right = np.linalg.svd((camera_mm - seen).T @ (xyz_mm - middle))
    proper = np.diag([1.0, 1.0, np.linalg.det(left) * np.linalg.det(right)])
    rotation = left @ proper @ right
    return rotation, middle - rotation.T @ seen


PRIOR_SIGMA = np.array(
    [
        *(0.8, 15.0, 15.0, 0.5, 0.5, 0.5, 100.0, 100.0, 100.0),
        *(0.01, 0.01, 2e-3, 5e-5, 1e-6, 8e-4, 8e-4, 8e-4, 8e-4),
    ]
)
"""Prior σ of a view about its nominal one, in the order of `PARAMETERS`; its position is hardly known."""
_SETTLED = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class Resection:
    """Result of a resection.

    Attributes:
        view: The view.
        residual_px: (N, 2) observed minus computed; NaN where a target lies behind the camera.
    """

    view: View
    residual_px: Array

    @property
    def distance_px(self) -> Array:
        """(N,) length of the residuals; infinite behind the camera."""
        distance: Array = np.linalg.norm(self.residual_px, axis=1)
        return np.where(np.isnan(distance), np.inf, distance)


def resect(
    start: View,
    xyz_mm: Array,
    xy_px: Array,
    sigma_px: float,
    *,
    prior: View | None = None,
    most_steps: int = 12,
) -> Resection:
    """Find the view that sees N targets where they were seen, robustly against outliers.

    Every parameter is pulled toward the prior by its `PRIOR_SIGMA`, so any number of targets and any frame,
    even a planar one, give a result. It is accurate enough to tell targets apart; measuring needs the
    adjustment.

    Args:
        start: The view to start from.
        xyz_mm: (N, 3) targets.
        xy_px: (N, 2) frame pixels.
        sigma_px: Standard deviation of an image coordinate; residuals far beyond it are weighted down.
        prior: Centre of the prior; None for the start.
        most_steps: Greatest number of iterations; fewer if it converges.
    """
    middle, view = (prior or start).vector(), start
    for _ in range(most_steps):
        step = _step(view, middle, xyz_mm, xy_px, sigma_px)
        view = view.with_vector(view.vector() + step * PRIOR_SIGMA)
        if np.abs(step).max() < _SETTLED:
            break
    return Resection(view, xy_px - project(view, xyz_mm))


def _step(view: View, middle: Array, xyz_mm: Array, xy_px: Array, sigma_px: float) -> Array:
    """(18,) Gauss–Newton step, in units of `PRIOR_SIGMA`."""
    misfit = xy_px - project(view, xyz_mm)
    weight = _weight(misfit, sigma_px)[:, np.newaxis]
    seen = weight[:, 0] > 0
    slopes = parameter_derivatives(view, xyz_mm[seen]) * PRIOR_SIGMA * weight[seen, :, np.newaxis]
    flat, whitened = slopes.reshape(-1, len(PRIOR_SIGMA)), (misfit * weight)[seen].ravel()
    off = (view.vector() - middle) / PRIOR_SIGMA
    return np.linalg.solve(flat.T @ flat + np.eye(len(PRIOR_SIGMA)), flat.T @ whitened - off)


def _weight(misfit: Array, sigma_px: float) -> Array:
    """(N,) square roots of Cauchy weights, in 1/px; zero behind the camera."""
    square = (misfit * misfit).sum(axis=1) / sigma_px**2
    # Cauchy's weight is one half at 3 σ.
    weight: Array = 1.0 / (sigma_px * np.sqrt(1.0 + square / 9.0))
    return np.where(np.isnan(weight), 0.0, weight)


POSE = PARAMETERS[3:9]
LEAST_TARGETS = 4
"""Known targets of a view: three leave up to four poses."""
_MOST_TRIPLES = 30
_FAR_PX = 200.0
"""Distance beyond which an image point says nothing more against a pose; bad lenses reach half of it."""
_DIFFERENT = 0.1
"""Of an element of the axes, from which two poses are different ones."""
_LEAST_ANGLE_RAD = 0.03
"""Between two rays, from which their intersection is used to find other views."""


def with_starting_values(network: Network) -> Network:
    """Copy a network with starting values of all poses and unknown positions, from its image points alone.

    Args:
        network: Its views have a rough interior orientation (f to ten per cent), their handedness and any
            pose; of the targets those whose σ is finite are known, and at least four must be.

    Raises:
        MeasurementError: A view sees too few targets whose position is known or follows from others, or a
            target is seen by no two views from different directions; the message names them.
    """
    given = np.asarray(np.isfinite(network.target_sigma_mm).all(axis=1), np.bool_)
    known, views, xyz_mm = given.copy(), list(network.views), network.target_mm.copy()
    found: list[int] = []
    sight_lines = _SightLines(network)
    while len(found) < len(views):
        index = _next(network, known, found)
        seen = np.flatnonzero((network.view == index) & known[network.target])
        views[index] = pose(views[index], xyz_mm[network.target[seen]], network.xy_px[seen])
        found.append(index)
        sight_lines.add(index, views[index])
        # From all views so far, not the first two alone, whose intersections are the roughest.
        met, places = sight_lines.meet()
        known = given | met
        xyz_mm[met & ~given] = places[met & ~given]
    if lost := np.flatnonzero(~known & (network.sightings > 0)).tolist():
        raise MeasurementError(
            f"targets {', '.join(str(network.id_of(one)) for one in lost)} are not seen from two directions",
            "leave them out, or give their positions",
        )
    return replace(network, views=tuple(views), target_mm=xyz_mm)


def pose(view: View, xyz_mm: Array, xy_px: Array) -> View:
    """Find the pose in which a view of given interior orientation sees known targets.

    Args:
        view: The view; its pose is ignored.
        xyz_mm: (N, 3) at least four targets.
        xy_px: (N, 2) frame pixels.

    Raises:
        MeasurementError: There are fewer targets, they lie on a line, or no pose explains them.
    """
    tried = list(_poses(view, xyz_mm, xy_px))
    if len(xyz_mm) < LEAST_TARGETS or not tried:
        raise MeasurementError(
            f"{len(xyz_mm)} targets do not determine the pose of view {view.name}",
            f"at least {LEAST_TARGETS} targets that do not lie on a line must be seen and known",
        )
    tried.sort(key=lambda one: _misfit_px(one, xyz_mm, xy_px))
    # A plane seen from afar has two poses that hardly differ in their images; refined, one fits better.
    other = [one for one in tried if np.abs(one.axes - tried[0].axes).max() > _DIFFERENT]
    refined = [_refined(one, xyz_mm, xy_px) for one in (tried[0], *other[:1])]
    return min(refined, key=lambda one: one.sum_of_squares).views[0]


def _refined(view: View, xyz_mm: Array, xy_px: Array) -> Adjustment:
    network = Network(
        views=(view,),
        view=np.zeros(len(xy_px), np.intp),
        target=np.arange(len(xy_px)),
        xy_px=xy_px,
        sigma_px=np.ones(xy_px.shape),
        target_mm=xyz_mm,
        target_sigma_mm=np.zeros(xyz_mm.shape),
    )
    return adjust(network, Unknowns.of((view,), POSE))


def _next(network: Network, known: Mask, found: Sequence[int]) -> int:
    """The view not yet found that sees the most known targets."""
    counts = np.bincount(network.view[known[network.target]], minlength=len(network.views))
    counts[list(found)] = -1
    index = int(counts.argmax())
    if counts[index] < LEAST_TARGETS:
        names = ", ".join(view.name for at, view in enumerate(network.views) if at not in found)
        raise MeasurementError(
            f"no pose was found for views {names}: none sees {LEAST_TARGETS} targets whose position is known",
            "give more control points, or add images that overlap with the others",
        )
    return index


def _poses(view: View, xyz_mm: Array, xy_px: Array) -> Iterator[View]:
    """Views with every pose that some triples of targets allow."""
    ideal = correct_all(Rig.of_views([view]), xy_px.T[:, np.newaxis])[:, 0].T
    camera = np.column_stack([ideal * (view.handedness, 1.0), np.full(len(ideal), -view.f_mm)])
    directions = camera / np.linalg.norm(camera, axis=1, keepdims=True)
    for triple in _triples(xyz_mm):
        for rotation, center in poses_of_three(directions[triple], xyz_mm[triple]):
            turned = view.with_axes(np.diag([view.handedness, 1.0, 1.0]) @ rotation)
            x, y, z = center.tolist()
            yield replace(turned, X0_mm=x, Y0_mm=y, Z0_mm=z)


def _triples(xyz_mm: Array) -> list[list[int]]:
    """Indices of three targets far apart, several times; those on a line are left out."""
    middle = xyz_mm.mean(axis=0)
    outer = np.argsort(-np.linalg.norm(xyz_mm - middle, axis=1))[:8].tolist()
    sized = []
    for triple in combinations(outer, 3):
        first, second, third = xyz_mm[list(triple)]
        area = float(np.linalg.norm(np.cross(second - first, third - first)))
        sized.append((area, list(triple)))
    sized.sort(reverse=True)
    least = 1e-3 * float(np.ptp(xyz_mm, axis=0).max()) ** 2
    return [triple for area, triple in sized[:_MOST_TRIPLES] if area > least]


def _misfit_px(view: View, xyz_mm: Array, xy_px: Array) -> float:
    """Mean distance of targets from their images, no more than `_FAR_PX` each, also behind the camera."""
    apart = np.linalg.norm(project(view, xyz_mm) - xy_px, axis=1)
    return float(np.nan_to_num(np.minimum(apart, _FAR_PX), nan=_FAR_PX).mean())


class _SightLines:
    """Rays of the views found so far, summed up for every target."""

    def __init__(self, network: Network) -> None:
        self._network = network
        self._across = np.zeros((len(network.target_mm), 3, 3))
        self._toward = np.zeros(network.target_mm.shape)

    def add(self, index: int, view: View) -> None:
        """Add the rays of a view."""
        own = self._network.view == index
        center, directions = rays(view, self._network.xy_px[own])
        some = np.isfinite(directions).all(axis=1)
        target, direction = self._network.target[own][some], directions[some]
        across = np.eye(3) - direction[:, :, np.newaxis] * direction[:, np.newaxis]
        # A view has at most one image point of a target.
        self._across[target] += across
        self._toward[target] += across @ center

    def meet(self) -> tuple[Mask, Array]:
        """Intersect them: (T,) True where rays of different directions meet, and (T, 3) nearest to all."""
        met = np.linalg.eigvalsh(self._across)[:, 0] > 1 - np.cos(_LEAST_ANGLE_RAD)
        places = np.zeros(self._toward.shape)
        places[met] = np.linalg.solve(self._across[met], self._toward[met][:, :, np.newaxis])[:, :, 0]
        return met, places


def with_glass(calibration: Calibration, plate: Plate, places_mm: Array) -> Calibration:
    """Adjust the views of a calibration to what the rig would see through a plate.

    Equations (4)–(7) absorb the plate's effect to some thousandths of a pixel, so measuring needs no other
    model. Covariance and local fields are kept, since they belong to the mirrors and the lens. The real
    thickness and tilt of the plate are not verified; calibrating through it is better.

    Args:
        calibration: Calibration made without glass.
        plate: Plate between the cameras and the object.
        places_mm: (N, 3) positions that fill the measuring volume, in depth too; a hundred are enough.

    Raises:
        MeasurementError: The positions do not determine the views, as `adjust`.
    """
    views = calibration.views
    pictures = np.concatenate([project_through(plate, view, places_mm) for view in views])
    network = Network(
        views=views,
        view=np.repeat([0, 1], len(places_mm)),
        target=np.tile(np.arange(len(places_mm)), 2),
        xy_px=pictures,
        sigma_px=np.ones_like(pictures),
        target_mm=places_mm,
        target_sigma_mm=np.zeros_like(places_mm),
    )
    left, right = adjust(network, Unknowns.of(views)).views
    glass = {"thickness_mm": plate.thickness_mm, "refractive_index": plate.refractive_index}
    return replace(calibration, left=left, right=right, glass=glass)
