"""Curvature, strain and tension of the wall in equilibrium, on its middle surface under the targets.

A smooth surface through the targets knows nothing beyond the outermost ones, where a closed wall folds; and
half a wall's thickness below a curvature that is a guess, so is the strain. The wall in equilibrium that
explains the targets bends there as rubber does.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.load.load_fit import Followers, Posterior, Response
from grabberd_liner.analysis.load.wall_model import WallModel
from grabberd_liner.analysis.wall.forms import mixed, principal_values
from grabberd_liner.analysis.wall.material import Material, Zone, wall_at
from grabberd_liner.analysis.wall.shell import UNKNOWNS, Geometry
from grabberd_liner.analysis.wall.splines import DERIVATIVES
from grabberd_liner.analysis.wall.tension import mixed_tension

Array = NDArray[np.float64]

_STEP = 1e-6
"""Of differences by the forms, in mm/mm and 1/mm, and by logarithms: all are of the order of .1 to 1."""
_KEPT = 2
"""Linearised walls whose followers are kept, 3 MB each: fields come in the order of the wall's departure."""
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
        self._known: list[Followers] = []

    def of(self, found: Posterior) -> MiddleSurface:
        """The middle surface of a wall that was fitted to its targets."""
        control = found.control
        values = self._of_forms(_forms(Geometry.of(self._model.targets, control)), found.parameters)
        sigma = found.sigma(self._followers(found.response)).reshape(values.shape)
        change = (values - self._open).reshape(len(values), -1, 2)
        model = np.multiply(_MODEL_SHARES, np.sqrt((change**2).mean(axis=(0, 2))))
        sigma = np.hypot(sigma, np.repeat(model, 2))
        pairs = [Estimate(values[:, k : k + 2], sigma[:, k : k + 2]) for k in (0, 2, 4)]
        return MiddleSurface(*pairs)

    def _followers(self, response: Response) -> Followers:
        """Quantities of a linearised wall, as they follow its parameters; made once for each wall."""
        known = next((one for one in self._known if one.response is response), None)
        if known is None:
            known = response.followers(self._by_parameters(response))
        self._known = [*[one for one in self._known if one is not known][1 - _KEPT :], known]
        return known

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
