"""The normal equations of a network, with the targets' places eliminated (Schur's complement)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.calibration.network import Network
from grabberd.calibration.unknowns import Unknowns
from grabberd.geometry import Rig, View, linearise, parameter_slopes, project_all

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


class State(NamedTuple):
    """Values of all unknowns: the views, and the targets' places (T, 3) in mm."""

    views: tuple[View, ...]
    xyz_mm: Array


class Design(NamedTuple):
    """Whitened slopes, zero where a target was not seen or a coordinate is held.

    Attributes:
        parameters: (2, V, 18, T) by the parameters of the view; `places`: (2, V, 3, T) by the target's place.
    """

    parameters: Array
    places: Array


class Normals(NamedTuple):
    """The normal equations of U parameters and T places.

    Attributes:
        matrix: (U, U) of the parameters alone; `right`: (U,).
        own: (T, 3, 3) of each place; `cross`: (T, 3, U) of place and parameters; `own_right`: (T, 3).
    """

    matrix: Array
    right: Array
    own: Array
    cross: Array
    own_right: Array


class Problem:
    """A network laid out with one column a target in every view: what a view does not see weighs nothing.

    Attributes:
        network: what is given; `unknowns`: what is sought.
        observed_px: (2, V, T); `weight`: (2, V, T) 1/σ, zero where a target was not seen.
        loose: (T, 3) bool, coordinates that are not held; `prior`: (T, 3) their 1/σ, 0 if unknown.
    """

    def __init__(self, network: Network, unknowns: Unknowns) -> None:
        self.network = network
        self.unknowns = unknowns
        self.selection = unknowns.selection
        shape = (2, len(network.views), len(network.target_mm))
        self.observed_px, self.weight = np.zeros(shape), np.zeros(shape)
        place = (slice(None), network.view, network.target)
        self.observed_px[place], self.weight[place] = network.xy_px.T, 1.0 / network.sigma_px.T
        self.loose: Mask = network.target_sigma_mm > 0
        self.prior = np.zeros(self.loose.shape)
        self.prior[self.loose] = 1.0 / network.target_sigma_mm[self.loose]

    @property
    def start(self) -> State:
        """The values to start from."""
        return State(self.network.views, self.network.target_mm)

    @property
    def freedom(self) -> int:
        """Degrees of freedom: image coordinates, less parameters and coordinates that nothing is known of."""
        return 2 * len(self.network) - len(self.unknowns) - int(np.isinf(self.network.target_sigma_mm).sum())

    def misfit(self, state: State) -> tuple[Array, Array]:
        """Whitened misclosures: of image points (2, V, T) and of places (T, 3); NaN behind a camera."""
        computed = project_all(Rig.of_views(state.views), state.xyz_mm)
        image = np.where(self.weight > 0, (self.observed_px - computed) * self.weight, 0.0)
        return image, (self.network.target_mm - state.xyz_mm) * self.prior

    def design(self, state: State) -> Design:
        """The slopes at a state."""
        rig, weight = Rig.of_views(state.views), self.weight[:, :, np.newaxis]
        seen = weight > 0
        parameters = np.where(seen, parameter_slopes(rig, state.xyz_mm) * weight, 0.0)
        if not self.loose.any():
            return Design(parameters, np.zeros((*self.weight.shape[:2], 3, len(state.xyz_mm))))
        places = np.where(seen & self.loose.T, linearise(rig, state.xyz_mm)[1] * weight, 0.0)
        return Design(parameters, places)

    def normals(self, state: State) -> Normals:
        """The normal equations at a state."""
        design, (image, offset) = self.design(state), self.misfit(state)
        matrix, right = self._of_parameters(design.parameters, image)
        own = np.einsum("cvkt,cvlt->tkl", design.places, design.places)
        own[:, range(3), range(3)] += np.where(self.loose, self.prior**2, 1.0)
        cross = np.einsum("cvkt,cvpt->tkvp", design.places, design.parameters).reshape(len(own), 3, -1)
        own_right = np.einsum("cvkt,cvt->tk", design.places, image) + offset * self.prior
        return Normals(matrix, right, own, cross @ self.selection, own_right)

    def _of_parameters(self, slopes: Array, image: Array) -> tuple[Array, Array]:
        """Views do not share slopes, so the full matrix is one block a view, folded onto the unknowns."""
        views, parameters = slopes.shape[1:3]
        flat = slopes.transpose(1, 2, 0, 3).reshape(views, parameters, -1)
        full = np.zeros((views, parameters, views, parameters))
        full[range(views), :, range(views)] = flat @ flat.swapaxes(1, 2)
        right = flat @ image.swapaxes(0, 1).reshape(views, -1, 1)
        folded = self.selection.T @ full.reshape(views * parameters, -1) @ self.selection
        return folded, self.selection.T @ right.ravel()
