"""The wall in equilibrium between and under its targets: its outer face, and curvature, strain and tension
of its middle surface.

The face is sampled at a lattice over the targets' material coordinates and made a spline there; between the
targets its errors are those of a smooth field. A smooth surface through the targets would know nothing
beyond the outermost ones, where a closed wall folds, nor of the strain half a wall's thickness below; the
wall in equilibrium bends there as rubber does.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy import sparse

from grabberd.core.arrays import Array, Indices, Mask
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.load.load_fit import Posterior, Response
from grabberd_liner.analysis.load.mounting import Mounting
from grabberd_liner.analysis.load.targets import TargetPlaces, Targets
from grabberd_liner.analysis.load.wall_model import WallModel
from grabberd_liner.analysis.surface.sections import is_within
from grabberd_liner.analysis.surface.smoothing import ROUND, Domain, modes
from grabberd_liner.analysis.wall.material import Material, Zone, mixed_tension, wall_at
from grabberd_liner.analysis.wall.shell import UNKNOWNS, Geometry
from grabberd_liner.analysis.wall.splines import DERIVATIVES, SplineAxis, SplineGrid
from grabberd_liner.analysis.wall.strain import mixed, principal_values

_PER_PITCH = 2, 3
"""Intervals of the lattice to a pitch of targets, along and round."""
_ALONG = 2.0
"""Pitches over which errors of the face go together along the tube; `ROUND` round it."""
_NUGGET = 1e-8
_SMALL = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class OuterFace:
    """The face at one field, a `Face`.

    Attributes:
        lattice: of the wall's model.
        control_mm: (K, 3) control values over the lattice.
        target_covariance_mm2: (3, T, 3 T) of the targets' places, in the object's frame: by axis and target.
        supported: as in `Surface`; `misfit`; `problems`.
    """

    lattice: "FaceLattice"
    control_mm: Array
    target_covariance_mm2: Array
    supported: Mask
    misfit: float
    problems: tuple[str, ...]

    @property
    def domain(self) -> Domain:
        """The grid of targets."""
        return self.lattice.domain

    def within(self, u_mm: Array, v_mm: Array) -> Mask:
        """(N,) True for positions supported by data."""
        return is_within(self.domain, self.supported, u_mm, v_mm)

    def places_mm(self, u_mm: Array, v_mm: Array) -> Estimate:
        """(N, 3) points X, each with σ."""
        values, members = self.lattice.splines(u_mm, v_mm, 1)
        by_targets = (values @ self.lattice.by_targets[members])[:, 0]
        count = by_targets.shape[1]
        of_axes = (one[:, k * count : (k + 1) * count] for k, one in enumerate(self.target_covariance_mm2))
        variances = [np.einsum("nt,nt->n", by_targets @ one, by_targets) for one in of_axes]
        variance = np.stack(variances, axis=1)
        places = (values @ self.control_mm[members])[:, 0]
        return Estimate(places, np.sqrt(np.maximum(variance, 0.0)))

    def tangents(self, u_mm: Array, v_mm: Array) -> Array:
        """(N, 3, 3) X, X_u, X_v."""
        values, members = self.lattice.splines(u_mm, v_mm, 3)
        return values @ self.control_mm[members]

    def covariance(self, weights: Array, u_mm: Array, v_mm: Array) -> Array:
        """(k, k) covariance of sums over positions of X, X_u, X_v with weights (k, N, at most 3, 3)."""
        count, places, derivatives, _ = weights.shape
        values, members = self.lattice.splines(u_mm, v_mm, derivatives)
        each = values.transpose(0, 2, 1) @ weights.transpose(1, 2, 0, 3).reshape(places, derivatives, -1)
        flat, size = members.ravel(), len(self.control_mm)
        gather = sparse.csr_matrix((np.ones(len(flat)), flat, np.arange(len(flat) + 1)), (len(flat), size))
        by_lattice = np.asarray(gather.T @ each.reshape(-1, 3 * count), np.float64)
        by_targets = self.lattice.by_targets.T @ by_lattice
        # By axis and target, as the covariance is.
        gradient = by_targets.reshape(-1, count, 3).transpose(1, 2, 0).reshape(count, -1)
        covariance = self.target_covariance_mm2.reshape(gradient.shape[1], -1)
        return np.asarray(gradient @ covariance @ gradient.T, np.float64)


class FaceLattice:
    """Places of the face that are sampled, and what they have to do with the targets.

    Attributes:
        domain: the grid of targets.
        by_targets: (K, T) control values over the lattice of a smooth field by its values at the targets.
        axes: (3, 3) rows: the liner's axes in the object's frame.
    """

    def __init__(self, grid: Grid, mounting: Mounting) -> None:
        """Finds the lattice on the mounted wall."""
        self.domain = Domain.of(grid)
        rows, columns = self.domain.rows, self.domain.columns
        reach_mm = 0.5 * grid.u_pitch_mm
        self._grid = SplineGrid(
            SplineAxis.over(0.0, (columns - 1) * grid.v_pitch_mm, _PER_PITCH[1] * (columns - 1)),
            SplineAxis.over(
                -reach_mm,
                (rows - 1) * grid.u_pitch_mm + reach_mm,
                _PER_PITCH[0] * rows,
            ),
        )
        around, along = self._grid.around.greville, self._grid.along.greville
        nodes = np.repeat(along, len(around)), np.tile(around, len(along))
        self._spline = np.linalg.inv(self._grid.basis(nodes[1], nodes[0]).matrices[0].toarray())
        smooth = _smooth(self.domain, (grid.u_mm, grid.v_mm), nodes)
        self.by_targets = self._spline @ smooth
        self._mounting, self.axes = mounting, mounting.frame.axes
        tube, targets = mounting.half.tube, mounting.targets
        # A lattice that reaches beyond the ends or the cuts ends there.
        end_s_mm, end_x_mm = np.pi / 2 * tube.radius_mm - _SMALL, tube.length_mm / 2 - _SMALL
        at = targets._replace(
            s_mm=np.clip(smooth @ targets.s_mm, -end_s_mm, end_s_mm),
            x_mm=np.clip(smooth @ targets.x_mm, -end_x_mm, end_x_mm),
        )
        self._places = TargetPlaces(mounting.half, Targets(*at))

    def face(self, found: Posterior, supported: Mask, problems: tuple[str, ...]) -> OuterFace:
        """The face of a wall that was fitted to its targets."""
        mounting, model = self._mounting, found.model
        tube = model.tube(found.parameters)
        in_frame = self._places.places_mm(model.half, found.control, tube)
        places_mm = mounting.frame.origin_mm + in_frame @ mounting.frame.axes
        covariance = self._in_object_frame(found.places_covariance(mounting.shared_mm2))
        misfit = float(found.outlying.sum()) / len(found.sights)
        return OuterFace(self, self._spline @ places_mm, covariance, supported, misfit, problems)

    def _in_object_frame(self, covariance_mm2: Array) -> Array:
        """(3, T, 3 T) by axis and target, of a covariance (3 T, 3 T) by target and axis of the liner's."""
        count = len(covariance_mm2) // 3
        by_target = covariance_mm2.reshape(count, 3, count, 3).transpose(1, 3, 0, 2).reshape(3, -1)
        half = (self.axes.T @ by_target).reshape(3, 3, -1)
        return (self.axes.T @ half).reshape(3, 3, count, count).transpose(0, 2, 1, 3).reshape(3, count, -1)

    def splines(self, u_mm: Array, v_mm: Array, count: int) -> tuple[Array, Indices]:
        """Values, derivatives by u and by v, as many as are wanted, of the splines that matter.

        Returns:
            (N, count, 16), and (N, 16) numbers of their control points.
        """
        values, members = _splines(self._grid, u_mm.tobytes(), v_mm.tobytes())
        return values[:, :count], members


@lru_cache(maxsize=32)
def _splines(grid: SplineGrid, u_mm: bytes, v_mm: bytes) -> tuple[Array, Indices]:
    """Splines as in `FaceLattice`; kept, because areas and targets ask for the same places at every field.

    All derivatives: what asks for a place's tangents asks for its covariance next.
    """
    u, v = np.frombuffer(u_mm), np.frombuffer(v_mm)
    along, around = grid.along.local(u), grid.around.local(v)
    parts = ((0, 0), (1, 0), (0, 1))
    values = [along[a][:, :, np.newaxis] * around[b][:, np.newaxis] for a, b in parts]
    return np.stack(values, axis=1).reshape(len(u), len(parts), -1), grid.members(v, u)


def _smooth(domain: Domain, targets: tuple[Array, Array], nodes: tuple[Array, Array]) -> Array:
    """(K, T) values at nodes of the smoothest field, by its values at the targets."""
    prior = modes(domain, _ALONG * domain.u_pitch_mm, ROUND * domain.v_pitch_mm)
    at_targets, at_nodes = (prior.jets(*places, highest=0)[:, 0] for places in (targets, nodes))
    covariance = at_targets @ at_targets.T
    nugget = _NUGGET * np.eye(len(covariance))
    return np.asarray(np.linalg.solve(covariance + nugget, at_targets @ at_nodes.T).T, np.float64)


_STEP = 1e-6
"""Of differences by the forms, in mm/mm and 1/mm, and by logarithms: all are of the order of .1 to 1."""
_PER_M = 1e3
_MODEL_SHARES = (0.1, 0.15, 0.15)
"""σ of the model itself, of curvature, strain and tension, by what they have changed since the liner was
mounted (root mean square over the targets): of a wall that bends in splines 2.7 × 5 mm long, and of one prior
for all teats. Found on the reference liner and the thin one."""


class MiddleSurface(NamedTuple):
    """The middle surface under the N targets, two principal values of each quantity, the greater first.

    Attributes:
        curvature_per_m: (N, 2) positive with the centre inside.
        strain: (N, 2) λ − 1 since the mounted, open liner.
        tension_n_per_m: (N, 2) by the material's law.
    """

    curvature_per_m: Estimate
    strain: Estimate
    tension_n_per_m: Estimate


class MiddleSurfaces:
    """Middle surfaces of one wall in state after state."""

    def __init__(self, model: WallModel, material: Material) -> None:
        """Takes the mounted wall for the reference state of strain.

        Args:
            model: the wall's.
            material: with the law of the tension.
        """
        self._model, self._material = model, material
        mounted = _forms(Geometry.of(model.targets, model.half.at_rest()))
        self._before = _tensors(mounted[:3])
        self._open = self._of_forms(mounted, np.zeros(model.count))

    def of(self, found: Posterior) -> MiddleSurface:
        """The middle surface of a wall that was fitted to its targets."""
        control = found.control
        values = self._of_forms(_forms(Geometry.of(self._model.targets, control)), found.parameters)
        followers = found.response.kept_followers(self, self._by_parameters)
        sigma = found.sigma(followers).reshape(values.shape)
        change = (values - self._open).reshape(len(values), -1, 2)
        model = np.multiply(_MODEL_SHARES, np.sqrt((change**2).mean(axis=(0, 2))))
        sigma = np.hypot(sigma, np.repeat(model, 2))
        pairs = [Estimate(values[:, k : k + 2], sigma[:, k : k + 2]) for k in (0, 2, 4)]
        return MiddleSurface(*pairs)

    def _by_parameters(self, response: Response) -> Array:
        """(6 N, P) derivatives at the state that was linearised."""
        state, targets = response.linear.state, self._model.targets
        geometry = Geometry.of(targets, state.control)
        forms = _forms(geometry)
        by_forms = _differences(lambda six: self._of_forms(six, state.parameters), forms)
        by_values = np.einsum("fnq,fndc->nqdc", by_forms, _forms_by_values(geometry), optimize=True)
        by = self._model.followed(response.linear, targets.by_control(by_values))
        start, before = self._model.of_tube.start, self._of_forms(forms, state.parameters)
        for index in range(start, start + 3):  # the law knows modulus, thickness and pretension as well
            parameters = state.parameters.copy()
            parameters[index] += _STEP
            by[:, index] += ((self._of_forms(forms, parameters) - before) / _STEP).ravel()
        return by

    def _of_forms(self, six: Array, parameters: Array) -> Array:
        """(N, 6) quantities of forms (6, N), by the liner's values among the parameters."""
        first, second = _tensors(six[:3]), _tensors(six[3:])
        curvature = _PER_M * principal_values(mixed(first, second))
        strain = np.sqrt(principal_values(mixed(self._before, first))) - 1
        young, thickness, pretension, _ = self._model.tube_values(parameters)
        changed = replace(
            self._material,
            E_mpa=self._material.E_mpa * np.exp(young),
            wall_mm=self._material.wall_mm * np.exp(thickness),
            F0_n=self._material.F0_n * np.exp(pretension),
        )
        wall = wall_at([Zone(-np.inf, np.inf, changed)], np.zeros(six.shape[1]))
        tension = _PER_M * principal_values(mixed_tension(first, self._before, wall))
        return np.concatenate([curvature, strain, tension], axis=1)


def _forms(geometry: Geometry) -> Array:
    """(6, N) components 11, 22, 12 of metric and curvature; 1 round the wall, 2 along it.

    The curvature is the surface's own: that of the shell's forms is its sheared normals'.
    """
    curvature = -np.einsum("ni,eni->en", geometry.normal, geometry.second)
    return np.concatenate([geometry.forms().metric, curvature])


def _forms_by_values(geometry: Geometry) -> Array:
    """(6, N, 5, 4) derivatives of `_forms` by the five derivatives of x, y, z, s."""
    by = geometry.forms_by_values()
    by[..., UNKNOWNS - 1] = 0.0
    assert by.shape[2] == len(DERIVATIVES) - 1
    return by


def _tensors(components: Array) -> Array:
    """(N, 2, 2) of components 11, 22, 12, along the tube first, as material laws have it."""
    around, along, across = components
    return np.stack([np.stack([along, across], axis=-1), np.stack([across, around], axis=-1)], axis=-2)


def _differences(function: Callable[[Array], Array], six: Array) -> Array:
    """(6, N, Q) derivatives by forms (6, N) of quantities (N, Q) of each point's own."""
    by = []
    for step in _STEP * np.eye(len(six))[:, :, np.newaxis]:
        by.append((function(six + step) - function(six - step)) / (2 * _STEP))
    return np.stack(by)
