"""The adjustment beside scipy.optimize.least_squares: one thread, medians, full covariance on both sides.

Both see the shipped calibration frame through the shipped calibration and start 5 % beside it. The peer has
the same analytic derivatives, computed once for a state; of its ways the fastest that ends at the same
minimum is the one compared with. Both stop where a step would change the sum of squares by less than 1e-8.
"""

import json
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.sparse import csr_array
from yaml import safe_load

from grabberd.config import default_config_file
from grabberd.core.calibration.adjustment.adjustment import Adjustment, AdjustmentSettings, adjust
from grabberd.core.calibration.adjustment.network import Network, Unknowns
from grabberd.core.geometry import Calibration, Rig, View, linearise_parameters, project

Array = NDArray[np.float64]

ROUNDS = 31
SIGMA_PX = 0.05
SETTLED = 1e-8
CASES = (("targets held", 0.0), ("targets weighted, σ .01 mm", 0.01))
WAYS: Mapping[str, Mapping[str, Any]] = {
    "lm": {"method": "lm"},
    "trf": {"method": "trf"},
    "trf, sparse lsmr": {"method": "trf", "tr_solver": "lsmr"},
}


class Peer(NamedTuple):
    """What the peer makes of a network: its unknowns, their covariance, the sum of squares."""

    x: Array
    covariance: Array
    omega: float


class Observations:
    """A network as the peer wants it: residuals and Jacobian of one vector of unknowns."""

    def __init__(self, given: Network, unknowns: Unknowns) -> None:
        self.given, self.unknowns = given, unknowns
        self.weighted = bool((given.target_sigma_mm > 0).any())
        self.start = unknowns.values(given.views)
        if self.weighted:
            self.start = np.concatenate([self.start, given.target_mm.ravel()])
        self._last: tuple[Array, Array, Array] | None = None
        self._layout()

    def fresh(self) -> "Observations":
        """The same, with nothing computed yet."""
        self._last = None
        return self

    def residuals(self, x: Array) -> Array:
        """Whitened, image points first."""
        return self._at(x)[0]

    def jacobian(self, x: Array) -> Array:
        """Of the residuals, dense."""
        return self._at(x)[1]

    def sparse(self, x: Array) -> csr_array:
        """Of the residuals; its pattern is known beforehand."""
        dense = self._at(x)[1]
        return csr_array((dense[self._rows, self._columns], self._columns, self._pointers), dense.shape)

    def _at(self, x: Array) -> tuple[Array, Array]:
        if self._last is None or not np.array_equal(self._last[0], x):
            self._last = (x.copy(), *self._linearised(x))
        return self._last[1], self._last[2]

    def _linearised(self, x: Array) -> tuple[Array, Array]:
        given, count = self.given, len(self.unknowns)
        views = self.unknowns.with_values(given.views, x[:count])
        places = x[count:].reshape(-1, 3) if self.weighted else given.target_mm
        computed, slopes = linearise_parameters(Rig.of_views(views), places)
        image = (computed[:, given.view, given.target] - given.xy_px.T) / given.sigma_px.T
        rows = slopes[:, given.view, :, given.target].swapaxes(0, 1) / given.sigma_px.T[:, :, np.newaxis]
        jacobian = self._empty.copy()
        blocks = self.unknowns.selection.reshape(len(views), rows.shape[2], count)
        for index, block in enumerate(blocks):
            jacobian[self._of_view[index], :count] = (
                rows[:, given.view == index].reshape(-1, len(block)) @ block
            )
        if not self.weighted:
            return image.ravel(), jacobian
        jacobian[self._image, self._own] = -rows[:, :, 6:9].reshape(-1, 3)
        prior = ((places - given.target_mm) / given.target_sigma_mm).ravel()
        return np.concatenate([image.ravel(), prior]), jacobian

    def _layout(self) -> None:
        given, count = self.given, len(self.unknowns)
        rows, size = 2 * len(given), len(self.start)
        self._empty = np.zeros((rows + size - count, size))
        self._of_view = [np.flatnonzero(np.tile(given.view == index, 2)) for index in range(len(given.views))]
        if self.weighted:
            self._empty[range(rows, len(self._empty)), range(count, size)] = 1 / given.target_sigma_mm.ravel()
            self._image = np.arange(rows)[:, np.newaxis]
            self._own = count + 3 * np.tile(given.target, 2)[:, np.newaxis] + np.arange(3)
        self._rows, self._columns = np.nonzero(self._linearised(self.start)[1])
        self._pointers = np.searchsorted(self._rows, np.arange(len(self._empty) + 1))


class Case(NamedTuple):
    """The same network for both, and the peer's fastest way to the same minimum and covariance."""

    name: str
    ours: Callable[[], Any]
    peer: Callable[[], Any]
    way: str


def table() -> str:
    """Medians in milliseconds, from nominal values to the minimum and the covariance of all unknowns."""
    head = "| unknowns | grabberd, ms | scipy, ms | which way | ratio |\n|---|---|---|---|---|"
    return "\n".join([head, *map(_row, cases())])


def cases() -> Iterator[Case]:
    """Ready to be timed; the ways are tried here."""
    for name, target_sigma_mm in CASES:
        yield _case(name, target_sigma_mm)


def _row(case: Case) -> str:
    ours, peer = (_median(work)[0] for work in (case.ours, case.peer))
    return f"| {case.name} | {1e3 * ours:.2f} | {1e3 * peer:.2f} | {case.way} | {ours / peer:.3f} |"


def _case(name: str, target_sigma_mm: float) -> Case:
    given = _network(target_sigma_mm)
    unknowns = Unknowns.of(given.views, tied=True)
    adjusted = _ours(given, unknowns)
    times = {way: _theirs(given, unknowns, options, adjusted) for way, options in WAYS.items()}
    way = min(times, key=lambda key: times[key])
    observations = Observations(given, unknowns)
    return Case(
        f"{len(observations.start)}, {name}",
        lambda: _ours(given, unknowns),
        lambda: _by_scipy(observations.fresh(), WAYS[way]),
        way,
    )


def _network(target_sigma_mm: float) -> Network:
    """What the shipped rig sees of its calibration frame, with errors; the start is up to 5 % beside it."""
    folder, rng = default_config_file().parent, np.random.default_rng(1)
    calibration = Calibration.from_document(json.loads((folder / "fake.calibration.json").read_text()))
    listed = safe_load((folder / "calibration-frames" / "paper-108.yaml").read_text())["targets"]
    places = np.array([[one["x_mm"], one["y_mm"], one["z_mm"]] for one in listed])
    views = tuple(replace(view, b=(*view.b[:8], view.b[7])) for view in calibration.views)
    xy = np.concatenate([project(view, places) for view in views])
    return Network(
        views=tuple(_nominal(view, rng) for view in views),
        view=np.repeat([0, 1], len(places)),
        target=np.tile(np.arange(len(places)), 2),
        xy_px=xy + rng.normal(0, SIGMA_PX, xy.shape),
        sigma_px=np.full(xy.shape, SIGMA_PX),
        target_mm=places + rng.normal(0, target_sigma_mm, places.shape),
        target_sigma_mm=np.full(places.shape, target_sigma_mm),
    )


def _nominal(view: View, rng: np.random.Generator) -> View:
    spread = np.array([0.4, 10.0, 10.0, 0.03, 0.03, 0.03, 4.0, 4.0, 12.0])
    values = view.vector()
    values[:9] += rng.uniform(-spread, spread)
    values[9:] = 0.0
    return view.with_vector(values)


def full_covariance(adjusted: Adjustment) -> Array:
    """(U + 3 T, U + 3 T) covariance of the unknowns, then of X, Y, Z of each target in turn."""
    targets, unknowns = len(adjusted.xyz_mm), len(adjusted.unknowns)
    coupling = adjusted.place_coupling.reshape(3 * targets, unknowns)
    scale = 1.0 / adjusted.sigma
    between = scale[:, np.newaxis] * np.linalg.solve(adjusted.correlation, (coupling * scale).T)
    full = np.empty((unknowns + 3 * targets, unknowns + 3 * targets))
    full[:unknowns, :unknowns], full[unknowns:, :unknowns] = adjusted.covariance, coupling
    full[:unknowns, unknowns:], full[unknowns:, unknowns:] = coupling.T, coupling @ between
    blocks = full[unknowns:, unknowns:].reshape(targets, 3, targets, 3)
    blocks[range(targets), :, range(targets)] = adjusted.place_covariance_mm2
    return full


def _ours(given: Network, unknowns: Unknowns) -> tuple[Adjustment, Array]:
    adjusted = adjust(given, unknowns, AdjustmentSettings(settled=SETTLED))
    return (
        adjusted,
        full_covariance(adjusted) if adjusted.network.target_sigma_mm.any() else adjusted.covariance,
    )


def _theirs(
    given: Network, unknowns: Unknowns, options: Mapping[str, Any], ours: tuple[Adjustment, Array]
) -> float:
    """The peer's time; infinite where it did not get to the same minimum and covariance."""
    observations = Observations(given, unknowns)
    taken, found = _median(lambda: _by_scipy(observations.fresh(), options), ROUNDS // 3)
    adjusted, covariance = ours
    away = np.abs(found.x[: len(unknowns)] - adjusted.values) / adjusted.sigma
    alike = np.allclose(
        np.diag(found.covariance)[: len(unknowns)], np.diag(covariance)[: len(unknowns)], rtol=0.05
    )
    return taken if away.max() < 0.1 and alike else np.inf


def _by_scipy(observations: Observations, options: Mapping[str, Any]) -> Peer:
    jacobian = observations.sparse if "tr_solver" in options else observations.jacobian
    found = least_squares(
        observations.residuals, observations.start, jacobian, x_scale="jac", ftol=SETTLED, **options
    )
    dense = observations.jacobian(found.x)
    scale = 1.0 / np.sqrt((dense * dense).sum(axis=0))
    scaled = dense * scale
    cofactor = np.linalg.inv(scaled.T @ scaled) * scale * scale[:, np.newaxis]
    freedom = len(found.fun) - len(found.x)
    return Peer(found.x, cofactor * 2 * found.cost / freedom, 2 * found.cost)


def _median(work: Callable[[], Any], rounds: int = ROUNDS) -> tuple[float, Any]:
    taken = []
    for _ in range(rounds):
        before = time.process_time()
        result = work()
        taken.append(time.process_time() - before)
    return float(np.median(taken)), result
