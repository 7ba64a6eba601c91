"""Least-squares collocation: residuals split into trend, errors of targets, a smooth signal, and noise.

    observed − computed = A·dp + J·dX + signal + noise

A·dp is the trend, all that the unknowns of the global model can absorb; J·dX are errors of the targets' given
positions, which the views share; the signal is correlated over a view, the noise is not. The trend is
estimated together with the signal (universal kriging), because fitted first it would absorb part of the
signal. Their sizes are those of greatest restricted likelihood.
"""

import math
from collections.abc import Iterable, Sequence
from itertools import product
from typing import NamedTuple, TypeAlias

import numpy as np

from grabberd.core.arrays import Array, Indices
from grabberd.core.calibration.adjustment.network import Network, Unknowns
from grabberd.core.geometry import Rig, View, linearise, parameter_slopes

_UNKNOWN_MM = 10.0
"""Stands for the infinite σ of an unknown position: an image point determines it far better."""
_ALONE_PX = 1e-6
"""Correlation length below all distances, so that every image point has its own signal."""


class Components(NamedTuple):
    """Sizes of signal, noise and position errors.

    Attributes:
        signal_px: Standard deviation s of the signal in each coordinate.
        length_px: l of its covariance s² exp(−d²/2l²) at a distance d in frame pixels.
        noise: σ of the image points, as a multiple of the given one.
        place: σ of the targets' positions, likewise.
    """

    signal_px: float
    length_px: float
    noise: float
    place: float

    def covariance(self, distance_px: Array) -> Array:
        """Covariance of the signal at two positions; zero at infinite distance, which stands for another
        view.
        """
        return self.signal_px**2 * np.exp(-0.5 * (distance_px / self.length_px) ** 2)

    @property
    def uncorrelated(self) -> "Components":
        """The same signal without any spatial correlation."""
        return self._replace(length_px=_ALONE_PX)


class Collocation:
    """M image points as 2M observations, all x first, then all y.

    Attributes:
        network: Image points and targets.
        unknowns: U unknowns whose changes form the trend.
        views: Their start values.
        misclosure: (2M,) observed − computed from the targets' given positions.
        trend: (2M, U) slopes by the unknowns over their `scale` (U,), so that columns have length 1.
        by_places: (2M, 2M) covariance from the positions' given σ.
        distance_px: (M, M) distances of image points, infinite between virtual cameras.
        noise: (2M,) given variances.
    """

    def __init__(self, network: Network, unknowns: Unknowns, views: tuple[View, ...], xyz_mm: Array) -> None:
        self.network, self.unknowns, self.views = network, unknowns, views
        rig = Rig.of_views(views)
        computed, slopes = linearise(rig, xyz_mm)
        computed += network.offsets_px(rig, xyz_mm, slopes)
        own = slopes.swapaxes(2, 3)[:, network.view, network.target]
        moved = (own * (xyz_mm - network.target_mm)[network.target]).sum(axis=2)
        observed = network.xy_px.T - computed[:, network.view, network.target]
        self.misclosure = (observed + moved).ravel()
        slopes_by_unknowns = self._trend(xyz_mm)
        self.scale: Array = np.linalg.norm(slopes_by_unknowns, axis=0)
        self.trend = slopes_by_unknowns / self.scale
        self.by_places = self._by_places(own)
        self.distance_px = self.distances(network.view, network.xy_px)
        self.noise = (network.sigma_px.T**2).ravel()

    def distances(self, view: Indices | int, xy_px: Array) -> Array:
        """(N, M) distances from positions (N, 2) in a view, or one view each, to the image points."""
        camera = self.network.cameras(self.network.view)
        other = np.not_equal.outer(np.broadcast_to(self.network.cameras(view), len(xy_px)), camera)
        apart = np.linalg.norm(xy_px[:, np.newaxis] - self.network.xy_px, axis=2)
        return np.where(other, np.inf, apart)

    def covariance(self, components: Components) -> Array:
        """(2M, 2M) covariance of the observations, without the trend."""
        count = len(self.network)
        total: Array = components.place**2 * self.by_places
        total[np.diag_indices(2 * count)] += components.noise**2 * self.noise
        signal = components.covariance(self.distance_px)
        total[:count, :count] += signal
        total[count:, count:] += signal
        return total

    def likelihood(self, components: Components) -> float:
        """Restricted log likelihood: that of everything no change of the unknowns can explain."""
        from scipy.linalg import lapack  # noqa: PLC0415 - 20 MB with what it loads, for calibrations alone

        # Upper in numpy's order is lower in Fortran's, so that nothing is copied.
        root, failed = lapack.dpotrf(self.covariance(components).T, lower=1, overwrite_a=1, clean=0)
        if failed:
            return -np.inf
        right = np.column_stack([self.trend, self.misclosure])
        white, _ = lapack.dtrtrs(root, right, lower=1)
        normal = white.T @ white
        step = np.linalg.solve(normal[:-1, :-1], normal[:-1, -1])
        squares = normal[-1, -1] - normal[-1, :-1] @ step
        spread = 2 * np.log(np.diag(root)).sum() + np.linalg.slogdet(normal[:-1, :-1])[1]
        return -0.5 * float(squares + spread)

    def _trend(self, xyz_mm: Array) -> Array:
        network = self.network
        slopes = parameter_slopes(Rig.of_views(self.views), xyz_mm).swapaxes(2, 3)
        rows = np.zeros((2, len(network), len(self.views), slopes.shape[3]))
        rows[:, range(len(network)), network.view] = slopes[:, network.view, network.target]
        return rows.reshape(2 * len(network), -1) @ self.unknowns.derivatives(self.views)

    def _by_places(self, slopes: Array) -> Array:
        target = self.network.target
        sigma = np.minimum(self.network.target_sigma_mm, _UNKNOWN_MM)[target]
        scaled = slopes * sigma
        shared: Array = np.einsum("cik,djk->cidj", scaled, scaled)
        shared *= np.equal.outer(target, target)[np.newaxis, :, np.newaxis]
        return shared.reshape(2 * len(target), -1)


class Solution:
    """Collocation solved for given components.

    Attributes:
        collocation: The collocation.
        components: The components.
        inverse: (2M, 2M) inverse covariance.
        projected: (2M, 2M) the same with the trend projected out.
        influence: (2M,) weights that turn covariances with the image points into predictions.
        cofactor: (U, U) covariance of the scaled unknowns.
    """

    def __init__(self, collocation: Collocation, components: Components) -> None:
        self.collocation, self.components = collocation, components
        self.inverse: Array = np.asarray(np.linalg.inv(collocation.covariance(components)), np.float64)
        weighted = self.inverse @ collocation.trend
        self.cofactor: Array = np.asarray(np.linalg.inv(collocation.trend.T @ weighted), np.float64)
        self.projected: Array = self.inverse - weighted @ self.cofactor @ weighted.T
        self.influence: Array = self.projected @ collocation.misclosure

    def signal(self, view: Indices | int, xy_px: Array) -> Array:
        """(N, 2) float64 signal at positions (N, 2) of a view, or of one view each, frame pixels."""
        covariance = self.components.covariance(self.collocation.distances(view, xy_px))
        return covariance @ self.influence.reshape(2, -1).T

    def covariance(self, views: Sequence[int], xy_px: Array, trend: Array) -> Array:
        """(2, N, K, K) covariance in px² of trend and signal together, of x and of y, among K views.

        Args:
            views: Indices of the views, of different virtual cameras.
            xy_px: (K, N, 2) positions in each of them, frame pixels.
            trend: (K, 2, N, U) slopes of x and y by the unknowns there.
        """
        scaled = trend / self.collocation.scale
        distance = [self.collocation.distances(*one) for one in zip(views, xy_px, strict=True)]
        signal = self.components.covariance(np.array(distance))
        return np.stack([self._covariance(axis, signal, scaled[:, axis]) for axis in range(2)])

    def _covariance(self, axis: int, signal: Array, trend: Array) -> Array:
        count = signal.shape[2]
        own = slice(axis * count, (axis + 1) * count)
        known = signal @ self.inverse[own]
        left = trend - known @ self.collocation.trend
        learned = np.einsum("knm,lnm->nkl", known[:, :, own], signal)
        by_trend = np.einsum("knu,lnu->nkl", left @ self.cofactor, left)
        return self.components.signal_px**2 * np.eye(len(signal)) - learned + by_trend

    def held_out(self) -> Array:
        """(M, 2) prediction errors in px, with each target left out in turn, in all views together.

        A target left out enters neither trend nor signal; the components are those of all targets.
        """
        network, count = self.collocation.network, len(self.collocation.network)
        error = np.empty(2 * count)
        for target in np.unique(network.target):
            own = np.flatnonzero(network.target == target)
            rows = np.concatenate([own, count + own])
            # Errors of prediction from one inverse, without solving anew for every target left out.
            own_share = self.projected[np.ix_(rows, rows)]
            error[rows] = np.linalg.lstsq(own_share, self.influence[rows], rcond=None)[0]
        return error.reshape(2, count).T


Logs: TypeAlias = tuple[float, ...]

_LENGTH, _NOISE, _PLACE = 1, 2, 3
_START = ((-2.0, 0.0), (-0.5, 0.5, 1.5), (-1.0, 0.0), (-6.0, 0.0))
_LIMITS = ((-10.0, 2.0), (-1.0, 3.0), (-5.0, 5.0), (-6.0, 4.0))
"""Binary logarithms: of the signal relative to what the trend leaves, of the length relative to the targets'
distance (shorter ones no target shows, longer ones the global model absorbs), of the σ of noise and positions
relative to the given ones."""
_FINEST = 0.125


def most_likely(collocation: Collocation) -> Components:
    """Find the components of greatest restricted likelihood.

    The σ of noise and positions are estimated as multiples of the given ones: a certificate may be better or
    worse than stated, and only with its true σ can its errors be told from the signal.
    """
    search = _Search(collocation)
    return search.components(search.best())


def evidence_of(collocation: Collocation, components: Components) -> float:
    """Log likelihood of the most likely components over that of the best signal without any correlation."""
    search = _Search(collocation)
    alone = _Search(collocation, alone=True)
    return search.value_of(components) - alone.value(alone.best())


class _Search:
    """Likelihoods by binary logarithms of the components, each computed once; `alone`: of a signal that no
    two image points share, which stands for all noise.
    """

    def __init__(self, collocation: Collocation, *, alone: bool = False) -> None:
        self._collocation = collocation
        self._units = _left_px(collocation), _spacing_px(collocation), 1.0, 1.0
        axes = range(4 if collocation.by_places.any() else 3)
        self._axes = [axis for axis in axes if not (alone and axis in (_LENGTH, _NOISE))]
        self._alone = alone
        self._known: dict[Logs, float] = {}

    def best(self) -> Logs:
        """The best of the start values, improved until no neighbour is better."""
        logs, step = max(self.grid(), key=self.value), 0.5
        while step >= _FINEST:
            best = max(self.around(logs, step), key=self.value)
            if self.value(best) > self.value(logs):
                logs = best
            else:
                step /= 2
        return logs

    def grid(self) -> Iterable[Logs]:
        """Start values."""
        return product(*(start if axis in self._axes else (0.0,) for axis, start in enumerate(_START)))

    def around(self, logs: Logs, step: float) -> Iterable[Logs]:
        """Neighbours along each axis, within the limits."""
        for axis, sign in product(self._axes, (-1, 1)):
            low, high = _LIMITS[axis]
            moved = min(max(logs[axis] + sign * step, low), high)
            yield (*logs[:axis], moved, *logs[axis + 1 :])

    def value(self, logs: Logs) -> float:
        """Log likelihood, with a prior that the given σ of noise is right to a factor of about two."""
        if logs not in self._known:
            self._known[logs] = self.value_of(self.components(logs))
        return self._known[logs]

    def value_of(self, components: Components) -> float:
        """The same of components."""
        return self._collocation.likelihood(components) - 0.5 * math.log2(components.noise) ** 2

    def components(self, logs: Logs) -> Components:
        """Convert the logarithms to components; held positions have no errors."""
        sizes = [unit * 2.0**log for unit, log in zip(self._units, logs, strict=False)]
        found = Components(sizes[0], sizes[1], sizes[2], sizes[3] if _PLACE in self._axes else 0.0)
        return found.uncorrelated if self._alone else found


def _left_px(collocation: Collocation) -> float:
    """Root mean square of what the trend leaves."""
    step = np.linalg.lstsq(collocation.trend, collocation.misclosure, rcond=None)[0]
    left = collocation.misclosure - collocation.trend @ step
    return float(np.sqrt((left**2).mean()))


def _spacing_px(collocation: Collocation) -> float:
    """Median distance of an image point to its nearest neighbour."""
    apart = collocation.distance_px + np.where(np.eye(len(collocation.network)) > 0, np.inf, 0.0)
    return float(np.median(apart.min(axis=1)))
