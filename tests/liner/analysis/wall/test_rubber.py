"""Rubber through the thickness: closed forms of thick bodies, exact derivatives, volume that is kept."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from grabberd_liner.analysis.wall.rubber import Forms, RubberWall, complex_step

RADIUS, WALL, SHEAR = 12.5, 2.5, 1.3
INNER, OUTER = RADIUS - WALL / 2, RADIUS + WALL / 2
FACES = (-0.5, 0.5)
COMPONENTS = ((0, 0), (1, 1), (0, 1))
SMALL = st.floats(-0.08, 0.08)
SIX = st.lists(SMALL, min_size=6, max_size=6)


def point(*values: float) -> Forms:
    """Forms a11, a22, a12, b11, b22, b12 at one point."""
    six = np.array(values)[:, np.newaxis]
    return Forms(six[:3], six[3:])


def cylinder(radius: float, stretch: float = 1.0) -> Forms:
    """A tube whose parameter round it is a length at RADIUS."""
    return point((radius / RADIUS) ** 2, stretch**2, 0.0, radius / RADIUS**2, 0.0, 0.0)


def sphere(radius: float) -> Forms:
    metric, curvature = (radius / RADIUS) ** 2, radius / RADIUS**2
    return point(metric, metric, 0.0, curvature, curvature, 0.0)


def sheet(departure) -> Forms:
    """A plane whose forms depart by six values."""
    return point(*np.array([1.0, 1.0, 0.0, 0.0, 0.0, 0.0]) + departure)


def matrices(forms: Forms) -> list:
    """Both forms of one point as 2 × 2 matrices."""
    return [np.array([[form[0], form[2]], [form[2], form[1]]])[..., 0] for form in forms]


def wall(unstressed: Forms, thickness: float = WALL) -> RubberWall:
    return RubberWall(unstressed, np.full(unstressed.metric.shape[1], thickness), SHEAR)


def slope(rubber: RubberWall, forms: Forms, by_six) -> float:
    """Derivative of the energy along a direction of the six components."""
    return float(rubber.resultants(forms)[:, 0] @ by_six)


def cylinder_pressure(radius: float) -> float:
    """Pressure on the outside that the energy needs to keep a tube at a radius of its middle."""
    by_radius = np.array([2 * radius, 0, 0, 1, 0, 0]) / RADIUS**2
    # W' R dθ dr = −p r dθ dr: the volume that the outer face sweeps is that of the middle.
    return -slope(wall(cylinder(RADIUS)), cylinder(radius), by_radius) * RADIUS / radius


def some(seed: int) -> tuple[RubberWall, Forms]:
    """Walls of any shape, bent, stretched and sheared at will."""
    rng = np.random.default_rng(seed)
    flat = np.array([1.0, 1.0, 0.0])[:, np.newaxis]
    metric = flat + 0.1 * rng.normal(size=(3, 7))
    unstressed = Forms(metric, 0.05 * rng.normal(size=(3, 7)))
    return wall(unstressed), Forms(metric + 0.1 * rng.normal(size=(3, 7)), 0.05 * rng.normal(size=(3, 7)))


def test_a_thick_cylinder_yields_to_a_small_pressure_as_lame_says():
    pressure = 1e-7
    shrunk = pressure * INNER**2 * OUTER**2 / (2 * SHEAR * (OUTER**2 - INNER**2)) / RADIUS
    assert cylinder_pressure(RADIUS - shrunk) == pytest.approx(pressure, rel=1e-5)


@pytest.mark.parametrize("radius", [10.0, 12.3, 14.0])
def test_a_thick_neo_hookean_cylinder_bears_the_integral_of_its_hoop_stress(radius):
    shrunk = RADIUS**2 - radius**2

    def hoop_over_radius(rest: float) -> float:
        stretch2 = 1 - shrunk / rest**2
        return (1 / stretch2 - stretch2) * rest / (rest**2 - shrunk)

    exact = SHEAR * quad(hoop_over_radius, INNER, OUTER)[0]
    assert cylinder_pressure(radius) == pytest.approx(exact, rel=1e-7)


@pytest.mark.parametrize("radius", [11.0, 12.3, 14.0])
def test_a_thick_neo_hookean_sphere_bears_the_integral_of_its_hoop_stress(radius):
    by_radius = np.array([2 * radius, 2 * radius, 0, 1, 1, 0]) / RADIUS**2
    pressure = -slope(wall(sphere(RADIUS)), sphere(radius), by_radius) * RADIUS**2 / radius**2
    shrunk = RADIUS**3 - radius**3

    def hoop_over_radius(now: float) -> float:
        stretch = now / np.cbrt(now**3 + shrunk)
        return -2 * (stretch**2 - stretch**-4) / now

    faces = np.cbrt(np.array([INNER, OUTER]) ** 3 - shrunk)
    assert pressure == pytest.approx(SHEAR * quad(hoop_over_radius, *faces)[0], rel=1e-6)


@pytest.mark.parametrize(("inner", "rel"), [(40.0, 1e-7), (6.0, 1e-5), (2.0, 3e-3)])
def test_a_block_bends_under_rivlins_moment_alone(inner, rel):
    # Faces without load: r₁ r₂ = A², where r = A is unstretched; and area is kept: r₂² − r₁² = 2 A t.
    roots = np.roots([1, 0, 0, -2 * WALL * inner**2, -(inner**4)])
    neutral = roots[np.isreal(roots)].real.max()
    outer = neutral**2 / inner
    middle = np.sqrt((inner**2 + outer**2) / 2)
    rubber = wall(point(1, 1, 0, 0, 0, 0))
    bent = point((middle / neutral) ** 2, 1, 0, middle / neutral**2, 0, 0)
    angle = 1 / neutral

    def radial(radius: float) -> float:
        def lifted(at: float) -> float:
            return (at**2 / neutral**2 + neutral**2 / at**2) / 2

        return SHEAR * (lifted(radius) - lifted(outer))

    def hoop(radius: float) -> float:
        return radial(radius) + SHEAR * (radius**2 / neutral**2 - neutral**2 / radius**2)

    moment = quad(lambda radius: hoop(radius) * radius, inner, outer)[0]
    by_angle = np.array([2 * middle**2 * angle, 0, 0, 2 * middle * angle, 0, 0])
    by_middle = np.array([2 * middle * angle**2, 0, 0, angle**2, 0, 0])
    assert slope(rubber, bent, by_angle) == pytest.approx(moment, rel=rel)
    assert slope(rubber, bent, by_middle) == pytest.approx(0.0, abs=rel * moment)
    assert middle + rubber.layer(bent, -0.5).depth_mm == pytest.approx(inner)
    assert middle + rubber.layer(bent, 0.5).depth_mm == pytest.approx(outer)


@pytest.mark.parametrize("stretch", [0.8, 1.04, 1.5])
def test_a_tube_that_is_pulled_narrows_and_stores_the_energy_of_the_pull(stretch):
    rubber = wall(cylinder(RADIUS))
    pulled = cylinder(RADIUS / np.sqrt(stretch), stretch)
    energy = SHEAR / 2 * WALL * (stretch**2 + 2 / stretch - 3)
    assert rubber.energy(pulled) == pytest.approx(energy, rel=1e-9)
    by_radius = np.array([2 / np.sqrt(stretch) / RADIUS, 0, 0, 1 / RADIUS**2, 0, 0])
    assert slope(rubber, pulled, by_radius) == pytest.approx(0.0, abs=1e-9)
    by_stretch = np.array([0, 2 * stretch, 0, 0, 0, 0])
    assert slope(rubber, pulled, by_stretch) == pytest.approx(SHEAR * WALL * (stretch - stretch**-2))
    faces = [rubber.layer(pulled, share).depth_mm[0] for share in FACES]
    assert faces == pytest.approx([-WALL / 2 / np.sqrt(stretch), WALL / 2 / np.sqrt(stretch)])


@pytest.mark.parametrize("shape", [cylinder(RADIUS), sphere(RADIUS), point(1, 1.2, 0.3, 0.1, -0.05, 0.02)])
def test_a_wall_at_rest_bears_nothing(shape):
    assert wall(shape).energy(shape) == pytest.approx(0.0, abs=1e-14)
    assert wall(shape).resultants(shape) == pytest.approx(np.zeros((6, 1)), abs=1e-13)


@settings(max_examples=30, deadline=None)
@given(SIX, SIX, st.lists(st.floats(-1.5, 1.5), min_size=4, max_size=4))
def test_energy_does_not_depend_on_the_parameters_of_the_surface(unstressed, deformed, values):
    jacobian = np.reshape(values, (2, 2)) + 2 * np.eye(2)
    assume(np.linalg.det(jacobian) > 0.1)

    def renamed(forms: Forms) -> Forms:
        both = [jacobian.T @ form @ jacobian for form in matrices(forms)]
        return point(*(form[component] for form in both for component in COMPONENTS))

    before, after = sheet(unstressed), sheet(deformed)
    assert wall(renamed(before)).energy(renamed(after)) == pytest.approx(
        wall(before).energy(after), rel=1e-9, abs=1e-12
    )


@settings(max_examples=30, deadline=None)
@given(SIX, SIX, st.sampled_from([-0.5, -0.2, 0.3, 0.5]))
def test_every_layer_keeps_its_volume(unstressed, deformed, share):
    before, after = sheet(unstressed), sheet(deformed)
    depth = wall(before).layer(after, share).depth_mm[0]
    assert _volume(after, depth) == pytest.approx(_volume(before, share * WALL), rel=1e-8)


def _volume(forms: Forms, depth: float) -> float:
    """Between the middle surface and a depth, per area of the parameters, by quadrature of layers' areas."""
    metric, curvature = matrices(forms)
    shape = np.linalg.solve(metric, curvature)
    return (
        np.sqrt(np.linalg.det(metric)) * quad(lambda z: np.linalg.det(np.eye(2) + z * shape), 0.0, depth)[0]
    )


@settings(max_examples=30, deadline=None)
@given(SIX, SIX)
def test_any_change_of_shape_costs_energy(unstressed, deformed):
    before, after = sheet(unstressed), sheet(deformed)
    assert wall(before).energy(after)[0] >= -1e-13


@pytest.mark.parametrize("component", range(6))
def test_resultants_are_the_energys_derivatives(component):
    rubber, forms = some(1)
    six = np.concatenate(forms).astype(complex)
    six[component] += 1e-30j
    by_component = rubber.energy(Forms(six[:3], six[3:])).imag / 1e-30
    assert rubber.resultants(forms)[component] == pytest.approx(by_component, rel=1e-11, abs=1e-13)


@pytest.mark.parametrize("component", range(6))
@pytest.mark.parametrize("share", FACES)
def test_a_layer_says_how_the_forms_move_it(component, share):
    rubber, forms = some(2)
    six = np.concatenate(forms).astype(complex)
    six[component] += 1e-30j
    by_component = rubber.layer(Forms(six[:3], six[3:]), share).depth_mm.imag / 1e-30
    assert rubber.layer(forms, share).by_forms[component] == pytest.approx(by_component, rel=1e-11, abs=1e-14)


def test_stiffness_is_symmetric_and_that_of_the_resultants():
    rubber, forms = some(3)
    stiffness = rubber.stiffness(forms)
    assert stiffness == pytest.approx(stiffness.transpose(1, 0, 2), abs=1e-12)
    six, step = np.concatenate(forms), 1e-6
    for component in range(6):
        shift = step * (np.arange(6) == component)[:, np.newaxis]
        high, low = (rubber.resultants(Forms((six + s)[:3], (six + s)[3:])) for s in (shift, -shift))
        assert stiffness[:, component] == pytest.approx((high - low) / (2 * step), rel=1e-6, abs=1e-7)


def test_area_is_that_of_the_wall_without_stress():
    assert wall(cylinder(11.0, 1.2)).area == pytest.approx(1.2 * 11.0 / RADIUS)


def test_complex_steps_lose_no_digits():
    at = np.array([[0.3, 2.0], [1.1, -0.7]])
    slopes = complex_step(lambda v: np.stack([v[0] ** 2 * v[1], np.exp(v[1])]), at)
    expected = [[2 * at[0] * at[1], at[0] ** 2], [np.zeros(2), np.exp(at[1])]]
    assert slopes == pytest.approx(np.array(expected), rel=1e-15)
