"""The solver against closed forms: thick cylinder, mandrel, buckling, touch, axial stretch, friction."""

import numpy as np
import pytest
from scipy.integrate import quad
from tools.liner_wall.designs import DESIGNS, mounted, mounting_stretch
from tools.liner_wall.equilibrium import Friction, NoEquilibrium, _facet_friction, _facet_load
from tools.liner_wall.mesh import Array
from tools.liner_wall.path import _snap, follow
from tools.liner_wall.rubber import Rubber
from tools.liner_wall.slabs import solve_slabs
from tools.liner_wall.teat import Teat

from .ring import RADIUS_MM, SHEAR_MPA, nothing, on_axis, ring


def bending_stiffness(wall_mm: float) -> float:
    """D of incompressible rubber, N·mm."""
    return 3 * SHEAR_MPA * wall_mm**3 / 12 / 0.75


def test_thick_neo_hookean_cylinder_meets_its_closed_form() -> None:
    tube = ring(wall_mm=2.5)
    nodes = tube.solve(tube.at_rest(), 0.009, nothing).nodes_mm
    inner, outer = RADIUS_MM - 1.25, RADIUS_MM + 1.25
    shrunk = inner**2 - np.linalg.norm(on_axis(tube, nodes, 0.0, 0.0)[1:]) ** 2

    def slope(radius: float) -> float:
        stretch2 = 1 - shrunk / radius**2
        return (1 / stretch2 - stretch2) * radius / (radius**2 - shrunk)

    assert SHEAR_MPA * quad(slope, inner, outer)[0] == pytest.approx(0.009, rel=1e-4)


def test_small_pressure_gives_lames_hoop_stress() -> None:
    tube = ring(wall_mm=2.5)
    state = tube.solve(tube.at_rest(), 1e-5, nothing)
    a, b = RADIUS_MM - 1.25, RADIUS_MM + 1.25
    bricks = tube.mesh.bricks
    stress = tube.stress_mpa(state)
    shapes = bricks.nodes[:, -1]  # the node in the middle of each brick
    y, z = state.nodes_mm[shapes, 1], state.nodes_mm[shapes, 2]
    radius = np.hypot(y, z)
    across = np.stack([np.zeros_like(y), z / radius, -y / radius], axis=-1)
    middle = stress[:, stress.shape[1] // 2]
    hoop = np.einsum("ei,eij,ej->e", across, middle, across)
    expected = -1e-5 * b**2 / (b**2 - a**2) * (1 + a**2 / radius**2)
    np.testing.assert_allclose(hoop, expected, rtol=5e-3)


def test_tube_on_a_snug_rigid_mandrel_presses_on_it_with_the_whole_difference() -> None:
    tube = ring(wall_mm=2.5)
    mandrel = Teat(
        "mandrel", RADIUS_MM - 1.25, 1e4, cap_mm=1.0, taper=0.0, stiffness_mpa_per_mm=3e4, firm_mm=1e9
    )
    state = tube.at_rest()
    for pressure_mpa in (0.001, 0.01, 0.042):
        state = tube.solve(state, pressure_mpa, mandrel.pressure)
    face = tube.mesh.inner
    contact, _ = mandrel.pressure(face.shapes @ state.nodes_mm[face.nodes])
    assert contact.mean() == pytest.approx(0.042, rel=1e-3)
    assert np.ptp(contact) < 2e-3 * 0.042


@pytest.mark.parametrize("wall_mm", [0.5, 1.0])
def test_thin_ring_buckles_at_3d_over_r_cubed(wall_mm: float) -> None:
    critical_mpa = 3 * bending_stiffness(wall_mm) / RADIUS_MM**3
    ovality = 1e-4
    tube = ring(wall_mm, ovality=ovality, arcs=18)
    state, amplitudes, shares = tube.at_rest(), [], np.array([0.5, 0.7, 0.8, 0.9])
    for share in shares:
        state = tube.solve(state, share * critical_mpa, nothing)
        y = on_axis(tube, state.nodes_mm, np.pi / 2, 0.5)[1]
        z = on_axis(tube, state.nodes_mm, 0.0, 0.5)[2]
        amplitudes.append((y - z) / 2 - ovality * RADIUS_MM)
    # Southwell: amplitude = critical · amplitude / pressure − imperfection
    slope = np.polyfit(np.array(amplitudes) / shares, amplitudes, 1)[0]
    assert slope == pytest.approx(1.0, abs=0.006)


def test_perfect_ring_stays_round_beyond_buckling_but_is_stable_only_before() -> None:
    critical_mpa = 3 * bending_stiffness(1.0) / RADIUS_MM**3
    tube = ring(wall_mm=1.0, arcs=18)
    for share, stays in ((0.9, True), (1.1, False)):
        state = tube.solve(tube.at_rest(), share * critical_mpa, nothing)
        y, z = (on_axis(tube, state.nodes_mm, angle, 0.5)[i] for angle, i in ((np.pi / 2, 1), (0.0, 2)))
        assert y == pytest.approx(z, abs=1e-6)
        assert tube.is_stable(state, share * critical_mpa, nothing) is stays


def test_opposite_walls_of_a_thin_ring_touch_at_their_known_pressure() -> None:
    wall_mm = 0.8
    touch_mpa = 5.24687 * bending_stiffness(wall_mm) / RADIUS_MM**3
    tube = ring(wall_mm, ovality=2e-3)
    heights, pressures = [], []
    for rest in follow(tube, tube.at_rest(), 0.5 * touch_mpa, 1.04 * touch_mpa, 0.04 * touch_mpa, nothing):
        heights.append(on_axis(tube, rest.state.nodes_mm, 0.0, 0.5)[2])
        pressures.append(rest.outer_mpa / touch_mpa)
    assert np.interp(0.0, heights[::-1], pressures[::-1]) == pytest.approx(1.0, abs=0.03)


def test_a_wall_that_has_lost_its_balance_flows_to_the_state_that_it_reaches_step_by_step() -> None:
    tube = ring(wall_mm=1.5, ovality=5e-3)
    critical_mpa = 3 * bending_stiffness(1.5) / RADIUS_MM**3
    round_ = tube.solve(tube.at_rest(), 0.5 * critical_mpa, nothing)
    snapped = _snap(tube, round_, 1.15 * critical_mpa, nothing)
    *_, stepped = follow(tube, round_, 0.5 * critical_mpa, 1.15 * critical_mpa, 0.05 * critical_mpa, nothing)
    height, expected = (on_axis(tube, one.nodes_mm, 0.0, 0.5)[2] for one in (snapped, stepped.state))
    assert expected < 0.9 * RADIUS_MM
    assert height == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize("design", [DESIGNS[0], DESIGNS[2]], ids=lambda design: design.name)
def test_mounted_tube_pulls_with_its_pretension(design) -> None:
    tube, state = mounted(design, fineness=0.5)
    volume = np.linalg.det(tube.gradient(state.nodes_mm))
    np.testing.assert_allclose(volume, 1.0, atol=2e-3)
    state = tube.solve(state, 0.0, nothing)
    area_mm2 = 2 * np.pi * design.radius_mm * design.wall_mm
    assert tube.stress_mpa(state)[..., 0, 0].mean() * area_mm2 == pytest.approx(design.pretension_n, rel=5e-3)
    assert mounting_stretch(design) > 1.03


def test_forces_and_their_derivatives_agree() -> None:
    tube = ring(wall_mm=2.5, rubber=Rubber(1.0, stiffening=0.5))
    rng = np.random.default_rng(1)
    teat = Teat("soft", 11.5, 1e3, cap_mm=5.0, stiffness_mpa_per_mm=0.01)
    nodes = tube.undeformed_mm + 0.05 * rng.normal(size=tube.undeformed_mm.shape)
    face = tube.mesh.inner
    shift = 1e-5 * rng.normal(size=nodes.shape)
    before, derivative = _facet_load(face, nodes, teat.pressure)
    after, _ = _facet_load(face, nodes + shift, teat.pressure)
    predicted = np.einsum("faibk,fbk->fai", derivative, shift[face.nodes])
    np.testing.assert_allclose(after - before, predicted, atol=2e-3 * np.abs(predicted).max())


def test_stress_and_stiffness_agree() -> None:
    rng = np.random.default_rng(2)
    rubber = Rubber(1.2, stiffening=0.4)
    gradient = np.eye(3) + 0.1 * rng.normal(size=(5, 3, 3))
    pressure = rng.normal(size=5)
    change = 1e-6 * rng.normal(size=(5, 3, 3))
    moved = rubber.stress(gradient + change, pressure) - rubber.stress(gradient - change, pressure)
    predicted = np.einsum("niJkL,nkL->niJ", rubber.stiffness(gradient, pressure), 2 * change)
    np.testing.assert_allclose(moved, predicted, rtol=1e-4, atol=1e-9)


def test_friction_of_a_sliding_face_is_its_coefficient_times_the_pressure() -> None:
    tube = ring(wall_mm=2.5)
    along = tube.undeformed_mm + np.array([50.0, 0.0, 0.0])

    def press(points_mm: Array) -> tuple[Array, Array]:
        return np.full(points_mm.shape[:-1], 0.02), np.zeros(points_mm.shape)

    load, _ = _facet_friction(tube.mesh.inner, along, press, Friction(0.3, tube.undeformed_mm))
    area_mm2 = np.pi / 2 * (RADIUS_MM - 1.25) * 2.0
    assert load.sum(axis=(0, 1))[0] == pytest.approx(-0.3 * 0.02 * area_mm2, rel=1e-3)


def test_what_has_no_equilibrium_is_refused() -> None:
    tube = ring(wall_mm=0.5)
    with pytest.raises(NoEquilibrium, match="no equilibrium at 1e"):
        tube.solve(
            tube.at_rest(), 1.0, lambda points: (np.full(points.shape[:-1], np.nan), np.zeros(points.shape))
        )


def test_slabs_give_what_one_dense_system_gives() -> None:
    tube, _ = mounted(DESIGNS[1], fineness=0.25)
    mesh, rng = tube.mesh, np.random.default_rng(3)
    count = len(mesh.block)
    blocks = tuple(
        rng.normal(size=(len(nodes), 27, 3, 27, 3)) / 30
        for nodes in (mesh.bricks.nodes, mesh.outer.nodes, mesh.inner.nodes)
    )
    held = np.zeros((count, 3), bool)
    held[: mesh.per_section] = True
    forces = rng.normal(size=(count, 3))
    dense = 20 * np.eye(3 * count)
    for nodes, block in zip((mesh.bricks.nodes, mesh.outer.nodes, mesh.inner.nodes), blocks, strict=True):
        for members, values in zip(nodes, block, strict=True):
            rows = (3 * members[:, np.newaxis] + np.arange(3)).ravel()
            dense[np.ix_(rows, rows)] += values.reshape(81, 81)
    free = np.flatnonzero(~held.ravel())
    expected = np.zeros(3 * count)
    expected[free] = np.linalg.solve(dense[np.ix_(free, free)], forces.ravel()[free])
    shifts = solve_slabs(mesh, blocks, forces, held, drag=20.0)
    np.testing.assert_allclose(shifts.ravel(), expected, rtol=1e-6, atol=1e-8)
