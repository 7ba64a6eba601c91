"""Truth of the ellipse's wall: strain, curvature, tension, moment and pressure at its middle surface.

The wall is sampled on a grid round the tube and along it, and differentiated there as a Fourier series, which
it is: the collapse is one period of a cosine along the length. The same series interpolates at the targets;
no target, spline or fitted surface is involved. It is accurate to .001 kPa for deflections up to half the
radius, to .02 kPa up to .56 of it. Lengths are in mm and stress in MPa, so tension is in N/mm and moment in
N. The pressure is the one that equilibrium across the wall requires for the prescribed movement; there is no
teat, and along the wall the movement would require friction that does not exist.
"""

import math
from collections.abc import Mapping
from functools import cached_property, lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_fake import liner as ellipse
from grabberd_fake.liner import EllipseLiner, closure
from grabberd_fake.liner_options import EllipseOptions
from grabberd_fake.optics import Array
from grabberd_fake.options import FakeOptions
from grabberd_fake.vacuum import pulsation_kpa


class Sheet:
    """A surface over coordinates u = (u0, u1).

    Attributes:
        shape: (n, m) of the grid; `periods_mm`: period of each coordinate.
    """

    def __init__(self, periodic_mm: Array, secular: Array, periods_mm: tuple[float, float]) -> None:
        """The surface.

        Args:
            periodic_mm: (n, m, 3) periodic part of the points, at u_a = index · period / count.
            secular: (2, 3) contribution of the linear part to ∂S/∂u.
            periods_mm: periods of the two coordinates.
        """
        self.shape = periodic_mm.shape[:2]
        self.periods_mm = periods_mm
        self._periodic_mm, self._secular = periodic_mm, secular

    def derivative(self, values: Array, along: int) -> Array:
        """∂values/∂u_along of a periodic (n, m, …) quantity."""
        count = self.shape[along]
        waves = np.fft.rfftfreq(count, self.periods_mm[along] / count) * 2j * np.pi
        if count % 2 == 0:
            waves[-1] = 0.0  # the sine of the highest wave vanishes on the grid
        shape = [1] * values.ndim
        shape[along] = len(waves)
        spectrum = np.fft.rfft(values, axis=along) * waves.reshape(shape)
        return np.fft.irfft(spectrum, count, axis=along)

    def gradient(self, values: Array) -> Array:
        """(2, n, m, …) derivatives along both coordinates."""
        return np.stack([self.derivative(values, along) for along in (0, 1)])

    @cached_property
    def tangents(self) -> Array:
        """(2, n, m, 3) ∂S/∂u_a."""
        return self.gradient(self._periodic_mm) + self._secular[:, np.newaxis, np.newaxis]

    @cached_property
    def metric(self) -> Array:
        """(2, 2, n, m) g_ab = S_a · S_b."""
        return np.einsum("anmx,bnmx->abnm", self.tangents, self.tangents)

    @cached_property
    def area(self) -> Array:
        """(n, m) √det g."""
        return np.sqrt(determinant(self.metric))

    @cached_property
    def raised(self) -> Array:
        """(2, 2, n, m) g^ab."""
        return inverse(self.metric)

    @cached_property
    def normal(self) -> Array:
        """(n, m, 3) unit normal along S_0 × S_1, inward or outward as the coordinates run."""
        return np.cross(self.tangents[0], self.tangents[1]) / self.area[..., np.newaxis]

    @cached_property
    def _second(self) -> Array:
        """(2, 2, n, m, 3) ∂²S/∂u_a∂u_b."""
        return np.stack([self.gradient(tangent) for tangent in self.tangents])

    @cached_property
    def bending(self) -> Array:
        """(2, 2, n, m) n · ∂²S: the second fundamental form for this normal."""
        return np.einsum("abnmx,nmx->abnm", self._second, self.normal)

    @cached_property
    def _christoffel(self) -> Array:
        """(2, 2, 2, n, m) Γ^c_ab."""
        first = np.einsum("dnmx,abnmx->dabnm", self.tangents, self._second)
        return np.einsum("cdnm,dabnm->cabnm", self.raised, first)

    def double_divergence(self, tensor: Array) -> Array:
        """(n, m) ∇_a ∇_b M^ab of contravariant components (2, 2, n, m)."""
        christoffel = self._christoffel
        divergence = sum(np.stack([self.derivative(row[b], b) for row in tensor]) for b in (0, 1))
        divergence = divergence + np.einsum("abcnm,cbnm->anm", christoffel, tensor)
        divergence = divergence + np.einsum("bbcnm,acnm->anm", christoffel, tensor)
        flux = self.area * divergence
        return (self.derivative(flux[0], 0) + self.derivative(flux[1], 1)) / self.area

    def at(self, values: Array, u0: Array, u1: Array) -> Array:
        """(r, c, …) values of a periodic (n, m, …) quantity at u0 (r,) by u1 (c,), by its Fourier series."""
        first, second = (
            _interpolation(u, self.shape[along], self.periods_mm[along]) for along, u in enumerate((u0, u1))
        )
        return np.einsum("rn,cm,nm...->rc...", first, second, values, optimize=True)


def determinant(form: Array) -> Array:
    """Det of (2, 2, …)."""
    return form[0, 0] * form[1, 1] - form[0, 1] * form[1, 0]


def inverse(form: Array) -> Array:
    """Inverse of (2, 2, …)."""
    swapped = np.array([[form[1, 1], -form[0, 1]], [-form[1, 0], form[0, 0]]])
    return swapped / determinant(form)


def _interpolation(u: Array, count: int, period_mm: float) -> Array:
    """(r, count) weights of the grid's values in their Fourier series at u (r,)."""
    angle = 2 * np.pi * (u[:, np.newaxis] / period_mm - np.arange(count) / count)
    waves = np.arange(1, (count - 1) // 2 + 1)
    weights = 1 + 2 * np.cos(np.multiply.outer(angle, waves)).sum(axis=-1)
    if count % 2 == 0:
        weights = weights + np.cos(count / 2 * angle)
    return weights / count


def tension(options: EllipseOptions, reference: Array, metric: Array) -> Array:
    """Force per present length; the law takes the stretch from the free liner, mounting included."""
    along, around = pre_stretch(options)
    squares = np.array([[along**2, along * around], [along * around, around**2]])
    free = reference / squares.reshape(2, 2, *(1,) * (metric.ndim - 2))
    law = _linear if options.material.law == "linear" else _neo_hookean
    return law(options, free, metric, along * around)


def moment(options: EllipseOptions, metric: Array, change: Array) -> Array:
    """Bending moment D ((1 - ν) k + ν g tr k) of the change of curvature `change` (covariant, per mm)."""
    poisson = options.material.poisson
    stiffness = options.material.e_mpa * options.wall_mm**3 / 12 / (1 - poisson**2)
    return stiffness * _isotropic(inverse(metric), change, poisson)


def pre_stretch(options: EllipseOptions) -> tuple[float, float]:
    """Stretches along and round the liner due to its mounting: tension F/(2πR) along, none round it."""
    material = options.material
    wanted = material.pretension_n / (2 * math.pi * options.radius_mm * material.e_mpa * options.wall_mm)
    if material.law == "linear":
        return 1 + wanted, 1 - material.poisson * wanted
    # Newton's method on the neo-Hookean law of uniaxial tension; it has converged long before 40 steps.
    stretch = 1.0 + wanted
    for _ in range(40):
        stretch -= (stretch**2 - 1 / stretch - 3 * wanted) / (2 * stretch + 1 / stretch**2)
    return stretch, 1 / math.sqrt(stretch)


def _neo_hookean(options: EllipseOptions, free: Array, metric: Array, mounted: float) -> Array:
    """µ t0 λ3 (G^ab - λ3² g^ab) with the free liner's metric G and wall t0; λ3 is the wall's thinning."""
    thinning = np.sqrt(determinant(free) / determinant(metric))
    wall_mm = options.wall_mm * mounted * thinning
    return options.material.e_mpa / 3 * wall_mm * (inverse(free) - thinning**2 * inverse(metric))


def _linear(options: EllipseOptions, free: Array, metric: Array, mounted: float) -> Array:
    """E t/(1 - ν²) ((1 - ν) ε + ν g tr ε) of the stretches' excess over one, ε = V - 1 with V² = F Fᵀ."""
    stretch, square = np.sqrt(determinant(metric) / determinant(free)), inverse(free)
    both = np.sqrt(np.einsum("ab...,ab...->...", square, metric) + 2 * stretch)
    raised = inverse(metric)
    excess = (square + stretch * raised) / both - raised
    poisson = options.material.poisson
    stiffness = options.material.e_mpa * options.wall_mm / (1 - poisson**2)
    trace = np.einsum("ab...,ab...->...", excess, metric)
    return stiffness * ((1 - poisson) * excess + poisson * trace * raised)


def _isotropic(raised: Array, form: Array, poisson: float) -> Array:
    """(1 - ν) k^ab + ν g^ab tr k."""
    both = np.einsum("ac...,bd...,cd...->ab...", raised, raised, form)
    trace = np.einsum("ab...,ab...->...", raised, form)
    return (1 - poisson) * both + poisson * raised * trace


GRID = (64, 256)
"""Grid points along the tube and round it."""


class WallTruth(NamedTuple):
    """Truth of the wall's middle surface under N targets.

    The bases are orthonormal: 0 along the tube, 1 perpendicular to it in the wall, towards increasing s, that
    is y where the wall faces the cameras. κ > 0 has its centre inside.

    Attributes:
        ids: (N,) int32; `xyz_mm`: (N, 3) places of the middle surface.
        basis: (N, 2, 3) the present basis, object's frame; `normal`: (N, 3) outward.
        strain: (N, 2, 2) Green-Lagrange strain from the reference time, in the basis of that time.
        stretch: (N, 2) principal stretches, the greater first.
        direction: (N, 2, 3) their directions in the present wall, unit vectors, object's frame.
        curvature_per_m: (N, 2, 2) in the present basis, as are `tension_n_per_m` (from the free liner, by the
            wall's law) and `moment_n` (bending out of the open state).
        pressure_kpa: (N,) p_contact on the inner face; `wall_kpa`: (N,) T:κ - ∇∇:M, on the middle surface.
        pulsation_kpa: vacuum in the pulsation chamber; `liner_kpa`: in the liner.
    """

    ids: NDArray[np.int32]
    xyz_mm: Array
    basis: Array
    normal: Array
    strain: Array
    stretch: Array
    direction: Array
    curvature_per_m: Array
    tension_n_per_m: Array
    moment_n: Array
    pressure_kpa: Array
    wall_kpa: Array
    pulsation_kpa: float
    liner_kpa: float


def truth_of_wall(
    options: FakeOptions | Mapping[str, Any], time_ns: int, reference_ns: int | None = None
) -> WallTruth:
    """Truth of the ellipse's wall at a time; nothing to judge pressures by: it is not in equilibrium.

    Args:
        options: options of `FakeGrabber`; the scene has to be `ellipse`.
        time_ns: time of a field, or any other time on the same clock.
        reference_ns: time of the strain's reference state; the open liner by default. Tension and moment are
            always relative to the open, mounted liner.

    Raises:
        ValueError: the options are invalid, or the scene is another one.
    """
    options = options if isinstance(options, FakeOptions) else FakeOptions.read(options)
    if options.scene != "ellipse":
        raise ValueError(f"scene: {options.scene!r} is not the prescribed wall 'ellipse'")
    liner = options.ellipse
    reference = 0.0 if reference_ns is None else closure(liner, reference_ns)
    chamber = float(pulsation_kpa(liner, np.array(time_ns / 1e9)))
    return _truth(liner, closure(liner, time_ns), reference, chamber)


def _truth(options: EllipseOptions, closed: float, reference: float, chamber_kpa: float) -> WallTruth:
    here, before = _patch(options, closed), _patch(options, reference)
    axes, old_axes = _axes(here.metric), _axes(before.metric)
    lagrange = _tensor((here.metric - before.metric) / 2, old_axes)  # Green-Lagrange, (g - G)/2
    stretch, old_direction = _principal(lagrange)
    carried = np.einsum("nik,kan,anx->nix", old_direction, old_axes, here.tangents)
    load_kpa = 1000 * here.load_mpa
    contact_kpa = (options.vacuum.liner_kpa - chamber_kpa + load_kpa) / here.inner_area
    lowered = [np.einsum("ac...,bd...,cd...->ab...", here.metric, here.metric, t) for t in here.answers]
    return WallTruth(
        ids=EllipseLiner(options).ids,
        xyz_mm=here.xyz_mm,
        basis=np.einsum("ian,anx->nix", axes, here.tangents),
        normal=here.normal,
        strain=lagrange,
        stretch=stretch,
        direction=carried / stretch[..., np.newaxis],
        curvature_per_m=1000 * _tensor(here.curvature, axes),
        tension_n_per_m=1000 * _tensor(lowered[0], axes),
        moment_n=_tensor(lowered[1], axes),
        pressure_kpa=contact_kpa,
        wall_kpa=load_kpa,
        pulsation_kpa=chamber_kpa,
        liner_kpa=options.vacuum.liner_kpa,
    )


class _Patch(NamedTuple):
    """The wall at N targets, by its coordinates: tangents (2, N, 3), forms (2, 2, N), the rest (N, …)."""

    xyz_mm: Array
    tangents: Array
    normal: Array
    metric: Array
    curvature: Array
    answers: tuple[Array, Array]
    load_mpa: Array
    inner_area: Array


@lru_cache(maxsize=64)
def _patch(options: EllipseOptions, closed: float) -> _Patch:
    places_mm, wall = wall_sheet(options, closed)
    curvature, opened = -wall.bending, _open(options)
    force = tension(options, opened.metric, wall.metric)
    bend = moment(options, wall.metric, curvature + opened.bending)
    load = np.einsum("abnm,abnm->nm", force, curvature) - wall.double_divergence(bend)

    read = partial(_at_targets, options, wall)
    xyz_mm = read(places_mm)
    xyz_mm[:, 0] = EllipseLiner(options).wall(0).xyz_mm[:, 0]
    inner = _area_ratio(wall.metric, curvature, options.wall_mm / 2)
    return _Patch(
        xyz_mm=xyz_mm,
        tangents=read(wall.tangents, 1),
        normal=read(wall.normal),
        metric=read(wall.metric, 2),
        curvature=read(curvature, 2),
        answers=(read(force, 2), read(bend, 2)),
        load_mpa=read(load),
        inner_area=read(inner),
    )


@lru_cache(maxsize=4)
def _open(options: EllipseOptions) -> Sheet:
    return wall_sheet(options, 0.0)[1]


def wall_sheet(options: EllipseOptions, closed: float, grid: tuple[int, int] = GRID) -> tuple[Array, Sheet]:
    """The middle surface on a grid (n, m) of x = index · length / n and s = index · perimeter / m.

    Returns:
        (n, m, 3) the points without their x, and the surface.
    """
    radius, length = options.radius_mm, options.length_mm
    x_mm, arc = (np.arange(count) / count for count in grid)
    depth = options.deflection_mm / radius * closed * np.cos(np.pi * x_mm) ** 2
    # The profile is symmetric: half of the sections would be computed twice.
    p, back = np.unique(1.0 - depth, return_inverse=True)
    arcs, q = np.tile(2 * np.pi * arc, len(p)), ellipse.widened(p).repeat(grid[1])
    p = p.repeat(grid[1])
    theta = ellipse.eccentric_angle(p, q, arcs)
    round_mm = radius * np.column_stack([0 * p, q * np.sin(theta), p * np.cos(theta)])
    places_mm = round_mm.reshape(-1, grid[1], 3)[back]
    places_mm[..., 2] += options.axis_z_mm
    secular = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    return places_mm, Sheet(places_mm, secular, (length, 2 * np.pi * radius))


def _at_targets(options: EllipseOptions, wall: Sheet, values: Array, lead: int = 0) -> Array:
    """Values (lead × 2, n, m, …) at the targets, (lead × 2, N, …)."""
    x_mm, s_mm = (
        np.array([index - (count - 1) / 2 for index in range(count)]) * options.pitch_mm
        for count in (options.rows, options.columns)
    )
    last = np.moveaxis(values, range(lead), range(-lead, 0)) if lead else values
    read = wall.at(last, x_mm, s_mm)
    read = read.reshape(-1, *read.shape[2:])
    return np.moveaxis(read, range(-lead, 0), range(lead)) if lead else read


def _area_ratio(metric: Array, curvature: Array, depth_mm: float) -> Array:
    """Area of the face `depth_mm` inside by that of the middle surface: 1 - 2Hh + Kh²."""
    mixed = np.einsum("ac...,cb...->ab...", inverse(metric), curvature)
    return 1 - depth_mm * (mixed[0, 0] + mixed[1, 1]) + depth_mm**2 * determinant(mixed)


def _axes(metric: Array) -> Array:
    """(2, 2, N) components of the orthonormal basis: 0 along the first tangent, 1 towards the second."""
    first = 1 / np.sqrt(metric[0, 0])
    second = np.sqrt(metric[0, 0] / determinant(metric))
    zero = np.zeros_like(first)
    return np.array([[first, zero], [-metric[0, 1] / metric[0, 0] * second, second]])


def _tensor(form: Array, axes: Array) -> Array:
    """(N, 2, 2) of a covariant form (2, 2, N) in an orthonormal basis."""
    return np.einsum("ian,jbn,abn->nij", axes, axes, form)


def _principal(lagrange: Array) -> tuple[Array, Array]:
    """(N, 2) principal stretches, the greater first, and (N, 2, 2) their directions in the old basis."""
    values, vectors = np.linalg.eigh(lagrange)
    return np.sqrt(1 + 2 * values[:, ::-1]), np.swapaxes(vectors, 1, 2)[:, ::-1]
