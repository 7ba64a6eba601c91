"""The divergence of the moments, against shapes whose bending is known in closed form."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve

from analysis.shapes import curve, cylinder, sphere, torus
from grabberd.analysis.surface.jets import ORDERS
from grabberd.analysis.wall.bending import jets_gradient, middle_surface, moment_divergence
from grabberd.analysis.wall.taylor import Taylor, gradients

U, V = np.linspace(-30.0, 30.0, 7), np.linspace(-12.0, 12.0, 7)
TOUCH = 5.24687


def flat(count):
    nothing = Taylor(np.zeros((6, count)))
    return (nothing, nothing), (nothing, nothing)


def divergence(jets, depth=1.25, poisson=0.5, unbent=None):
    return moment_divergence(middle_surface(jets, depth), unbent or flat(len(jets)), poisson)


@pytest.mark.parametrize("jets", [cylinder(13.75, U, V), sphere(13.75, U / 4, V)], ids=["cylinder", "sphere"])
def test_what_is_bent_alike_everywhere_has_no_divergence(jets):
    assert divergence(jets).values[0] == pytest.approx(np.zeros(7), abs=1e-15)


def test_an_unbent_wall_has_none_wherever_it_stands():
    jets = torus(30.0, 8.0, U, V)
    unbent = middle_surface(jets, 1.25).second_per_mm
    assert divergence(jets, unbent=unbent).values[0] == pytest.approx(np.zeros(7), abs=1e-15)


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.5])
def test_of_a_wall_flat_when_unbent_it_is_the_laplacian_of_the_mean_curvature_whatever_poisson_s_ratio(
    poisson,
):
    """Codazzi: ∇∇:κ = Δ tr κ. On a torus of tube r and ring R: tr κ = 1/r + cos a / w, w = R + r cos a."""
    ring, tube, a = 30.0, 8.0 - 1.25, U / 8.0
    w = ring + tube * np.cos(a)
    slope = -ring * np.sin(a) / w**2
    bend = -ring * np.cos(a) / w**2 - 2 * ring * tube * np.sin(a) ** 2 / w**3
    laplacian = (bend - tube * np.sin(a) / w * slope) / tube**2
    result = divergence(torus(ring, 8.0, U, V), poisson=poisson).values[0]
    assert result == pytest.approx(laplacian, rel=1e-9, abs=1e-15)


def test_of_an_elliptic_ring_it_is_the_second_derivative_of_its_curvature_by_its_length():
    wide, high, angle = 15.0, 10.0, np.linspace(0.1, 1.4, 7)
    tangent, curvature = _ellipse(wide, high, angle)
    result = divergence(curve(tangent, curvature, 1.25)).values[0]
    assert result == pytest.approx(curvature[:, 2], rel=1e-9)


def _ellipse(wide, high, angle):
    """Tangents (y, z) of (a sin t, b cos t), its curvature and its derivatives by the length."""
    speed2 = wide**2 * np.cos(angle) ** 2 + high**2 * np.sin(angle) ** 2
    step, area = high**2 - wide**2, wide * high
    slope, turn = step * np.sin(2 * angle), 2 * step * np.cos(2 * angle)
    first = -1.5 * area * speed2**-3 * slope
    second = area * (-1.5 * turn * speed2**-3.5 + 4.5 * speed2**-4.5 * slope**2)
    tangent = np.stack([wide * np.cos(angle), -high * np.sin(angle)], axis=1) / np.sqrt(speed2)[:, None]
    return tangent, np.stack([area * speed2**-1.5, first, second, np.zeros_like(angle)], axis=1)


def ring(start, places):
    """The elastica: a ring of radius 1 and D = 1, two waves, this least curvature, under an even pressure.

    Returns:
        The pressure, tangents (y, z), curvature with three derivatives, tension c − κ²/2, least half width.
    """

    def wall(load, constant, at=None):
        def rates(_, state):
            kappa, slope, theta, _, _ = state
            return [slope, load + constant * kappa - kappa**3 / 2, kappa, np.cos(theta), -np.sin(theta)]

        return solve_ivp(rates, (0, np.pi / 2), [start, 0, 0, 0, 0], "DOP853", at, rtol=1e-12, atol=1e-13).y

    def miss(unknowns):
        end = wall(*unknowns)[:, -1]
        return [end[1], end[2] - np.pi / 2]

    load, constant = fsolve(miss, [3.0, -2.5], xtol=1e-13)
    kappa, slope, theta, _, _ = wall(load, constant, places)
    curvature = [kappa, slope, load + constant * kappa - kappa**3 / 2, (constant - 1.5 * kappa**2) * slope]
    tangent = np.stack([np.cos(theta), -np.sin(theta)], axis=1)
    half_width = -wall(load, constant)[4, -1]
    return load, tangent, np.stack(curvature, axis=1), constant - kappa**2 / 2, half_width


@pytest.mark.parametrize("start", [0.9, 0.3, -0.5])
def test_a_ring_held_by_an_even_pressure_shows_just_that_pressure(start):
    """−D κ″ with T = c − D κ²/2: what tension and bending carry is the load, the same all round."""
    radius, stiffness = 12.5, 5.2
    load, tangent, curvature, tension, _ = ring(start, np.linspace(0.0, np.pi / 2, 9))
    curvature = curvature / radius ** np.arange(1, 5)
    moments = divergence(curve(tangent, curvature, 1.35), 1.35).values[0]
    carried = stiffness * (tension / radius**2 * curvature[:, 0] - moments)
    assert carried == pytest.approx(np.full(9, -load * stiffness / radius**3), rel=1e-6)


def test_the_opposite_walls_of_a_ring_touch_at_5_24687_d_over_r_cubed():
    touching = brentq(lambda start: ring(start, [0.0])[4], -1.05, -0.9, xtol=1e-7)
    assert ring(touching, [0.0])[0] == pytest.approx(TOUCH, abs=5e-5)


def test_a_ring_leaves_its_circle_at_3_d_over_r_cubed():
    assert ring(0.999, [0.0])[0] == pytest.approx(3.0, abs=1e-5)


def test_one_sweep_backwards_gives_the_derivatives_that_differences_give():
    rng = np.random.default_rng(1)
    jets = torus(30.0, 8.0, U, V) + rng.normal(size=(7, 15, 3)) * 1e-3
    middle = middle_surface(jets, 1.25)
    result = moment_divergence(middle, flat(7), 0.3)
    own = [series for vector in middle.face for series in vector]
    found = jets_gradient(gradients([(result, np.ones((1, 7)))], own))
    for at, (i, j) in enumerate(ORDERS):
        step = np.zeros((15, 3))
        step[at, 2] = 1e-4 / 10.0 ** (i + j)
        rise = divergence(jets + step, poisson=0.3).values[0] - divergence(jets - step, poisson=0.3).values[0]
        expected = rise / (2 * step[at, 2])
        assert found[:, at, 2] == pytest.approx(expected, rel=1e-5, abs=1e-8), (i, j)
