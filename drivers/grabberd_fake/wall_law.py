"""Response of the wall to deformation: tension and bending moment, as tensors of its middle surface.

Components are contravariant in the coordinates of the material (along the tube, round the wall), (2, 2, …).
`reference` is the metric of the open, mounted liner, `metric` the present one. Lengths are in mm and stress
in MPa, so tension is in N/mm and moment in N.
"""

import math

import numpy as np

from grabberd_fake.ellipse_options import EllipseOptions
from grabberd_fake.optics import Array
from grabberd_fake.sheet import determinant, inverse


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


def strain(reference: Array, metric: Array) -> Array:
    """Green-Lagrange strain (g - G)/2, covariant."""
    difference: Array = (metric - reference) / 2
    return difference


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
    force: Array = options.material.e_mpa / 3 * wall_mm * (inverse(free) - thinning**2 * inverse(metric))
    return force


def _linear(options: EllipseOptions, free: Array, metric: Array, mounted: float) -> Array:
    """E t/(1 - ν²) ((1 - ν) ε + ν g tr ε) of the stretches' excess over one, ε = V - 1 with V² = F Fᵀ."""
    stretch, square = np.sqrt(determinant(metric) / determinant(free)), inverse(free)
    both = np.sqrt(np.einsum("ab...,ab...->...", square, metric) + 2 * stretch)
    raised = inverse(metric)
    excess = (square + stretch * raised) / both - raised
    poisson = options.material.poisson
    stiffness = options.material.e_mpa * options.wall_mm / (1 - poisson**2)
    trace = np.einsum("ab...,ab...->...", excess, metric)
    force: Array = stiffness * ((1 - poisson) * excess + poisson * trace * raised)
    return force


def _isotropic(raised: Array, form: Array, poisson: float) -> Array:
    """(1 - ν) k^ab + ν g^ab tr k."""
    both = np.einsum("ac...,bd...,cd...->ab...", raised, raised, form)
    trace = np.einsum("ab...,ab...->...", raised, form)
    tensor: Array = (1 - poisson) * both + poisson * raised * trace
    return tensor
