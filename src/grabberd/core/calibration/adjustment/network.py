"""Network and unknowns: the input of an adjustment.

A network is image points of targets with prior knowledge of their positions; the unknowns are those of the
views' parameters that are free, held, shared between views or tied.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.geometry import PARAMETERS, Discs, Rig, View
from grabberd.errors import InputError, MeasurementError

_HINT = "this is a bug in the caller: each target may occur once per view, and every σ must be above 0"


@dataclass(frozen=True, slots=True, eq=False)
class Network:
    """M image points of T targets in V views.

    Attributes:
        views: The views with start values; parameters that are not adjusted keep them.
        view: (M,) intp, index of the view that an image point lies in.
        target: (M,) intp, index of its target, at most once per view.
        xy_px: (M, 2) float64, frame pixels.
        sigma_px: (M, 2) float64, standard deviations, above 0.
        target_mm: (T, 3) float64, given positions of the targets, in the object's frame.
        target_sigma_mm: (T, 3) float64, their standard deviation: 0 if held, infinite if unknown (`target_mm`
            is then the start value).
        ids: (T,) ids of the targets for messages; None: their indices.
        camera: (V,) intp, virtual camera that a view is of, where one sees the calibration frame in several
            poses; None: each view is of its own.
        among_corrected: True for residuals between ideal points and corrected observed ones, as programs form
            them whose polynomial is a correction, instead of between points of the picture.

    Raises:
        MeasurementError: Shapes, indices or standard deviations are inconsistent.
    """

    views: tuple[View, ...]
    view: Indices
    target: Indices
    xy_px: Array
    sigma_px: Array
    target_mm: Array
    target_sigma_mm: Array
    ids: NDArray[np.int32] | None = None
    among_corrected: bool = False
    camera: Indices | None = None

    def __post_init__(self) -> None:
        count, targets = len(self.view), len(self.target_mm)
        if not (len(self.target) == count and self.xy_px.shape == self.sigma_px.shape == (count, 2)):
            raise MeasurementError(
                f"{count} image points come with other numbers of targets, positions or σ", _HINT
            )
        if not (self.target_mm.shape == self.target_sigma_mm.shape == (targets, 3)):
            raise MeasurementError(f"{targets} targets come with another number of σ", _HINT)
        if count and not (self.view.min() >= 0 and self.view.max() < len(self.views)):
            raise MeasurementError(f"an image point lies in none of the {len(self.views)} views", _HINT)
        if count and not (self.target.min() >= 0 and self.target.max() < targets):
            raise MeasurementError(f"an image point belongs to none of the {targets} targets", _HINT)
        if len(np.unique(self.view * targets + self.target)) < count:
            raise MeasurementError("a target has two image points in one view", _HINT)
        if self.among_corrected and any(view.polynomial == "distortion" for view in self.views):
            raise MeasurementError(
                "residuals among corrected points need views whose polynomial is a correction",
                'set polynomial="correction" in all of them',
            )
        known = np.isfinite(self.xy_px).all() and np.isfinite(self.target_mm).all()
        if not (known and (self.sigma_px > 0).all() and (self.target_sigma_mm >= 0).all()):
            raise MeasurementError("a position or a standard deviation is out of range or not finite", _HINT)

    def __len__(self) -> int:
        return len(self.view)

    def id_of(self, target: int) -> int:
        """Id of a target by its index, as people know it."""
        return target if self.ids is None else int(self.ids[target])

    def cameras(self, view: Indices | int) -> Indices:
        """Virtual cameras of views by their index, in the same shape."""
        return np.asarray(view) if self.camera is None else self.camera[view]

    @property
    def sightings(self) -> Indices:
        """(T,) number of views in which a target was seen."""
        return np.bincount(self.target, minlength=len(self.target_mm))

    @property
    def undetermined(self) -> Mask:
        """(T,) True for targets seen, but in too few views for the unknown part of their position."""
        lacking: Mask = 2 * self.sightings < np.isinf(self.target_sigma_mm).sum(axis=1)
        return lacking & (self.sightings > 0)

    def select(self, chosen: Mask) -> "Network":
        """Select image points (M,), keeping all targets and views."""
        return replace(
            self,
            view=self.view[chosen],
            target=self.target[chosen],
            xy_px=self.xy_px[chosen],
            sigma_px=self.sigma_px[chosen],
        )

    def of_targets(self, chosen: Indices) -> "Network":
        """Select targets by their indices, ascending, of which all image points are, and number them anew."""
        return replace(
            self,
            target=np.searchsorted(chosen, self.target),
            target_mm=self.target_mm[chosen],
            target_sigma_mm=self.target_sigma_mm[chosen],
            ids=None if self.ids is None else self.ids[chosen],
        )

    def offsets_px(self, rig: Rig, xyz_mm: Array, slopes: Array) -> Array:
        """(2, V, T) of the image points from the images of the targets' positions (T, 3): none.

        Args:
            rig: The views.
            xyz_mm: The positions.
            slopes: (2, V, 3, T) derivatives of the frame pixels by X, Y, Z there.
        """
        return np.zeros((2, len(rig.views), len(xyz_mm)))

    def starting_from(self, views: Sequence[View]) -> "Network":
        """Copy with other start values."""
        return replace(self, views=tuple(views))


@dataclass(frozen=True, slots=True, eq=False)
class DiscNetwork(Network):
    """Image points that are the middles of discs' pictures.

    Attributes:
        discs: The T targets.
    """

    discs: Discs = field(kw_only=True)

    def of_targets(self, chosen: Indices) -> "Network":
        """Select targets by their indices, ascending, of which all image points are, and number them anew."""
        selected: Network = Network.of_targets(replace(self, discs=self.discs.select(chosen)), chosen)
        return selected

    def offsets_px(self, rig: Rig, xyz_mm: Array, slopes: Array) -> Array:
        """(2, V, T) of the middles of the pictures from the images of the discs' centres (T, 3)."""
        return self.discs.offsets_px(rig, xyz_mm, slopes)


LENS = ("f_mm", "x0_px", "y0_px", "b3", "b4", "b5", "b6", "b7")
"""Parameters common to views through one lens; b1, b2, b8, b9 belong to the mirrors."""


@dataclass(frozen=True, slots=True, eq=False)
class Unknowns:
    """U unknowns behind the 18 parameters of each of V views.

    Attributes:
        names: U names: "left.f_mm"; "lens.f_mm" if all views share it; "left.b8=b9" if tied.
        number: (V, 18) intp, unknown behind each parameter; −1 if it is held.
    """

    names: tuple[str, ...]
    number: Indices

    @classmethod
    def of(
        cls,
        views: Sequence[View],
        free: Collection[str] = PARAMETERS,
        *,
        shared: Collection[str] = (),
        tied: bool = False,
    ) -> "Unknowns":
        """Choose the unknowns of views.

        Args:
            views: The views.
            free: Names of parameters to adjust: "b3" for all views, "left.b3" for one.
            shared: Parameters identical in all views, such as `LENS`.
            tied: True for b9 = b8 in every view, the paper's own model.

        Raises:
            InputError: A name is unknown, or a shared parameter is not free in all views.
        """
        _check_names(views, free, shared)
        names: dict[str, int] = {}
        number = np.full((len(views), len(PARAMETERS)), -1, np.intp)
        for index, view in enumerate(views):
            for column, parameter in enumerate(PARAMETERS):
                if parameter in free or f"{view.name}.{parameter}" in free:
                    name = _name(view.name, parameter, parameter in shared, tied)
                    number[index, column] = names.setdefault(name, len(names))
        return cls(tuple(names), number)

    def __len__(self) -> int:
        return len(self.names)

    @property
    def selection(self) -> Array:
        """(18 V, U) float64 zeros and ones: changes of the parameters from those of the unknowns."""
        flat = self.number.ravel()
        return (flat[:, np.newaxis] == np.arange(len(self))).astype(np.float64)

    def derivatives(self, views: Sequence[View]) -> Array:
        """(18 V, U) derivatives of the views' parameters by the unknowns."""
        return self.selection

    def values(self, views: Sequence[View]) -> Array:
        """(U,) values of the unknowns; the mean of parameters that share one."""
        flat, number = np.array([view.vector() for view in views]).ravel(), self.number.ravel()
        chosen = number >= 0
        total = np.bincount(number[chosen], flat[chosen], len(self))
        return total / np.bincount(number[chosen], minlength=len(self))

    def with_values(self, views: Sequence[View], values: Array) -> tuple[View, ...]:
        """Copy the views with other values (U,) of the unknowns; held parameters stay."""
        known = np.array([view.vector() for view in views])
        vectors = np.where(self.number >= 0, np.append(values, 0.0)[self.number], known)
        return tuple(view.with_vector(vector) for view, vector in zip(views, vectors, strict=True))

    def without(self, dropped: Collection[str]) -> "Unknowns":
        """Drop some unknowns: their parameters are held."""
        kept = [index for index, name in enumerate(self.names) if name not in dropped]
        renumbered = np.full(len(self) + 1, -1, np.intp)
        renumbered[kept] = np.arange(len(kept))
        return Unknowns(tuple(self.names[index] for index in kept), renumbered[self.number])

    def moved(self, views: Sequence[View], step: Array) -> tuple[View, ...]:
        """Apply a step (U,) of the unknowns to the views."""
        changes = np.append(step, 0.0)[self.number]
        return tuple(
            view.with_vector(view.vector() + change) for view, change in zip(views, changes, strict=True)
        )


def _name(view: str, parameter: str, shared: bool, tied: bool) -> str:
    label = "b8=b9" if tied and parameter in {"b8", "b9"} else parameter
    return f"{'lens' if shared else view}.{label}"


def _check_names(views: Sequence[View], free: Collection[str], shared: Collection[str]) -> None:
    own = {f"{view.name}.{parameter}" for view in views for parameter in PARAMETERS}
    unknown = sorted((set(free) - own - set(PARAMETERS)) | (set(shared) - set(PARAMETERS)))
    if unknown:
        raise InputError(
            f"no parameter is called {', '.join(unknown)}",
            f"parameters are {', '.join(PARAMETERS)}; one view's alone: {views[0].name}.{PARAMETERS[0]}",
        )
    if single := sorted(set(shared) - set(free)):
        raise InputError(
            f"{', '.join(single)} cannot be shared without being adjusted in all views",
            "adjust the parameter in all views, or do not share it",
        )


def matched(projected_px: Array, observed_px: Array, gate_px: float) -> tuple[Indices, Indices]:
    """Pair known points with the image points nearest to where they are expected.

    Args:
        projected_px: (K, 2) expected positions of the known points.
        observed_px: (N, 2) image points.
        gate_px: Greatest distance.

    Returns:
        Indices of known points and of their image points; only pairs that are each other's nearest.
    """
    if not len(projected_px) or not len(observed_px):
        return np.empty(0, np.intp), np.empty(0, np.intp)
    apart_px = np.linalg.norm(projected_px[:, np.newaxis] - observed_px, axis=2)
    nearest = mutual_nearest(np.where(np.isnan(apart_px), np.inf, apart_px), gate_px)
    known = np.flatnonzero(nearest >= 0)
    return known, nearest[known]


def mutual_nearest(apart_px: Array, gate_px: float) -> Indices:
    """(K,) column that is nearest to each row of distances (K, N), if that row is also nearest to it.

    −1 where it is not, or is farther than the gate.
    """
    nearest = apart_px.argmin(axis=1)
    row = np.arange(len(apart_px))
    mutual = (apart_px.argmin(axis=0)[nearest] == row) & (apart_px[row, nearest] <= gate_px)
    return np.where(mutual, nearest, -1)
