"""The wall's equilibrium: exact on shapes under an even pressure, and on the simulated liner."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from analysis.shapes import cylinder, moved, renamed, sheet, sphere, torus
from analysis.wall.test_material import rubber
from grabberd.analysis.surface.jets import ORDERS, index
from grabberd.analysis.wall.equilibrium import Equilibrium
from grabberd.analysis.wall.material import Zone
from grabberd_fake.liner import closure
from grabberd_fake.options import FakeOptions
from grabberd_fake.wall_truth import truth_of_wall, wall_sheet

U, V = np.linspace(-30.0, 30.0, 7), np.linspace(-12.0, 12.0, 7)
H = 1.35


def balance(reference, material=None, outward=1.0):
    return Equilibrium.of(
        [Zone(-1e3, 1e3, material or rubber())], np.zeros(len(reference)), reference, outward
    )


def contact(jets, reference, material=None, difference_kpa=42.0, outward=1.0):
    equilibrium = balance(reference, material, outward)
    return equilibrium.contact_kpa(equilibrium.shape(jets), difference_kpa)


def wall(jets, reference, material=None):
    equilibrium = balance(reference, material)
    return equilibrium.wall_kpa(equilibrium.shape(jets))


def test_a_blown_up_sphere_presses_by_two_tensions_over_its_radius():
    radius, before = 22.0 - H, 20.0 - H
    stretch, thin = radius / before, (before / radius) ** 2
    tension = 1e3 * 2.5 * thin * (stretch**2 - thin**2)
    result = wall(sphere(22.0, U / 4, V, stretch=1.1), sphere(20.0, U / 4, V), rubber(F0_n=0.0))
    assert result == pytest.approx(np.full(7, 2 * tension / radius), rel=1e-9)


def test_a_widened_tube_presses_by_its_tension_round_over_its_radius():
    around = (14.5 - H) / (13.85 - H)
    tension = 1e3 * 3 * 2.5 / (1 - 0.09) * ((around - 1) + 0.3 * (1.02 - 1))
    material = rubber(F0_n=0.0, law="linear", poisson=0.3)
    result = wall(cylinder(14.5, U, V, 1.02, 14.5 / 13.85), cylinder(13.85, U, V), material)
    assert result == pytest.approx(np.full(7, tension / (14.5 - H)), rel=1e-9)


def test_a_mounted_liner_at_rest_presses_nowhere():
    tube = cylinder(13.85, U, V)
    assert wall(tube, tube) == pytest.approx(np.zeros(7), abs=1e-9)


def test_the_pull_along_a_waist_presses_outward():
    """Pre-tension alone: T along the rows, which are curved outward; nothing round."""
    waist = torus(30.0, 8.0, np.full(7, np.pi * 8.0) + U / 10, V / 3)
    material = rubber(law="linear", poisson=0.0)
    pull = 1e3 * 60 / (2 * np.pi * 12.5)
    assert wall(waist, waist, material) == pytest.approx(np.full(7, pull / (8 - H)), rel=1e-9)


def test_the_pressure_acts_on_the_inner_face_which_is_smaller():
    tube = cylinder(13.85, U, V)
    assert contact(tube, tube, difference_kpa=42.0) == pytest.approx(np.full(7, 42.0 / (1 - 1.25 / 12.5)))


def test_a_flat_wall_waved_a_little_presses_by_its_bending_alone():
    """κ = −z″ and p = −D κ″; the wave is too low for a tension."""
    material, wave, height = rubber(F0_n=0.0, wall_mm=0.2, target_mm=0.0), 2 * np.pi / 40.0, 1e-6
    jets = sheet(U, V)
    for at, (i, j) in enumerate(ORDERS):
        if i == 0:
            jets[:, at, 2] = height * wave**j * np.sin(wave * V + j * np.pi / 2)
    expected = 1e3 * 3 * 0.2**3 / 12 / 0.75 * height * wave**4 * np.sin(wave * V)
    assert wall(jets, sheet(U, V), material) == pytest.approx(expected, rel=1e-4, abs=1e-15)


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 10**6))
def test_rigid_motion_changes_no_pressure(seed):
    rng = np.random.default_rng(seed)
    before = cylinder(13.85, U, V) + rng.normal(size=(7, 15, 3)) * 1e-4
    after = before + rng.normal(size=(7, 15, 3)) * 1e-3
    rotation, shift = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3) * 100
    expected = contact(after, before)
    assert contact(moved(after, rotation, shift), before) == pytest.approx(expected, rel=1e-8, abs=1e-8)
    assert contact(after, moved(before, rotation, shift)) == pytest.approx(expected, rel=1e-8, abs=1e-8)


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 10**6))
def test_other_coordinates_of_the_material_change_no_pressure(seed):
    """Without pre-tension, which has the direction of u."""
    rng = np.random.default_rng(seed)
    before = cylinder(13.85, U, V) + rng.normal(size=(7, 15, 3)) * 1e-4
    after = before + rng.normal(size=(7, 15, 3)) * 1e-3
    u_of, v_of = 0.05 * rng.normal(size=(2, 5, 5))
    u_of[0, 1] += 1.0
    v_of[1, 0] += 1.0
    expected = contact(after, before, rubber(F0_n=0.0))
    other = contact(renamed(after, u_of, v_of), renamed(before, u_of, v_of), rubber(F0_n=0.0), outward=-1.0)
    assert other == pytest.approx(expected, rel=1e-7, abs=1e-7)


@settings(max_examples=12, deadline=None)
@given(st.floats(-50, 50), st.floats(-50, 50))
def test_differences_of_pressure_superpose(first, second):
    tube, present = cylinder(13.85, U, V), torus(30.0, 8.0, U, V)
    both, one, other, none = (
        contact(present, tube, difference_kpa=kpa) for kpa in (first + second, first, second, 0.0)
    )
    assert both - none == pytest.approx((one - none) + (other - none), abs=1e-9)


@pytest.mark.parametrize("law", ["neo_hookean", "linear"])
def test_the_slopes_are_those_of_differences(law):
    rng = np.random.default_rng(2)
    before = cylinder(13.85, U, V) + rng.normal(size=(7, 15, 3)) * 1e-4
    after = before + rng.normal(size=(7, 15, 3)) * 1e-3
    material = rubber(law=law)
    equilibrium = balance(before, material)
    slope = equilibrium.slope(equilibrium.shape(after), 42.0)
    for at, (i, j) in enumerate(ORDERS):
        step = np.zeros((15, 3))
        step[at, 1] = 1e-4 / 10.0 ** (i + j)
        ahead = contact(after + step, before, material) - contact(after - step, before, material)
        behind = contact(after, before + step, material) - contact(after, before - step, material)
        assert slope.by_jets[:, at, 1] == pytest.approx(ahead / (2 * step[at, 1]), rel=1e-4, abs=1e-5)
        assert slope.by_reference[:, at, 1] == pytest.approx(behind / (2 * step[at, 1]), rel=1e-4, abs=1e-5)


def test_an_exact_reference_brings_no_slopes():
    tube = cylinder(13.85, U, V)
    equilibrium = Equilibrium.of([Zone(-1e3, 1e3, rubber())], U, tube, exact=True)
    slope = equilibrium.slope(equilibrium.shape(tube * 1.01), 42.0)
    assert not slope.by_reference.any()
    assert slope.by_jets.any()


@pytest.mark.parametrize("time_s", [0.05, 0.7, 0.9])
def test_the_simulated_liner_shows_the_pressure_that_its_own_law_has(time_s):
    """Exact jets of its outer face against closed forms on its middle surface, written by another hand."""
    options = FakeOptions.read({"scene": "liner"})
    truth = truth_of_wall(options, round(time_s * 1e9))
    liner = options.liner
    material = rubber(target_mm=liner.target_thickness_mm)
    before, now = (_face(liner, closed) for closed in (0.0, closure(liner, round(time_s * 1e9))))
    assert wall(now, before, material) == pytest.approx(truth.wall_kpa, abs=1e-5)
    difference = truth.liner_kpa - truth.pulsation_kpa
    assert contact(now, before, material, difference) == pytest.approx(truth.pressure_kpa, abs=1e-5)


def _face(liner, closed):
    """(108, 15, 3) jets of the outer face, by its Fourier series."""
    places, middle = wall_sheet(liner, closed)
    rows, round_ = places.shape[:2]
    along = np.fft.fftfreq(rows, 1 / rows) * 2j * np.pi / liner.length_mm
    across = np.fft.fftfreq(round_, 1 / round_) * 1j / liner.radius_mm
    x, s = ((np.arange(n) - (n - 1) / 2) * liner.pitch_mm for n in (liner.rows, liner.columns))
    waves = np.fft.fft2(places + liner.targets_over_middle_mm * middle.normal, axes=(0, 1)) / (rows * round_)
    jets = np.zeros((liner.rows, liner.columns, 15, 3))
    for at, (i, j) in enumerate(ORDERS):
        left, right = np.exp(np.outer(x, along)) * along**i, np.exp(np.outer(s, across)) * across**j
        jets[:, :, at] = np.einsum("an,nmc,bm->abc", left, waves, right, optimize=True).real
    jets[:, :, index(1, 0), 0] += 1.0
    jets[:, :, 0, 0] += x[:, None]
    return jets.reshape(-1, 15, 3)
