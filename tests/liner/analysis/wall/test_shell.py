"""The discretised wall: forces are derivatives of energies, stiffness is that of the forces."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from grabberd_liner.analysis.wall.rubber import Forms, RubberWall
from grabberd_liner.analysis.wall.shell import SHEAR_SHARE, Geometry, Load, Shell, inner_area
from grabberd_liner.analysis.wall.splines import SplineAxis, SplineGrid

RADIUS, WALL, SHEAR = 12.5, 2.5, 1.0
GRID = SplineGrid(SplineAxis.over(-19.0, 19.0, 5), SplineAxis.over(-20.0, 20.0, 4))
S, X, WEIGHTS = GRID.quadrature()
BASIS = GRID.basis(S, X)
COUNT = len(S)
STEP = 1e-5


def control_of(grid: SplineGrid, points):
    """Control values of the splines nearest to points of quadrature, without shear."""
    s, x, _ = grid.quadrature()
    dense = grid.basis(s, x).matrices[0].toarray()
    return np.column_stack([np.linalg.lstsq(dense, points, rcond=None)[0], np.zeros(grid.count)])


TUBE = control_of(GRID, np.stack([X, RADIUS * np.sin(S / RADIUS), RADIUS * np.cos(S / RADIUS)], axis=1))
RUBBER = RubberWall(Geometry.of(BASIS, TUBE).forms(), np.full(COUNT, WALL), SHEAR)
SHELL = Shell(BASIS, WEIGHTS, RUBBER)
NO_TRACTION = np.zeros((2, COUNT))
FREE = Load(0.0, np.zeros(COUNT), NO_TRACTION)
PRESSED = Load(0.03, 0.04 + 0.02 * np.sin(S / 5), NO_TRACTION)


def noise(seed: int, position: float, shear: float):
    rng = np.random.default_rng(seed)
    return rng.normal(size=TUBE.shape) * [position, position, position, shear]


DEFORMED = TUBE + noise(1, 0.2, 0.02)
SHIFT = noise(2, 1.0, 0.1)


def inside(shift):
    """The shift, but none at the edges of the wall nor of its slope there."""
    grid = shift.reshape(GRID.along.count, GRID.around.count, 4).copy()
    grid[[0, 1, -2, -1]] = 0
    grid[:, [0, 1, -2, -1]] = 0
    return grid.reshape(shift.shape)


def energy(control) -> float:
    geometry = Geometry.of(BASIS, control)
    shear = SHEAR_SHARE * SHEAR * WALL / 2 * RUBBER.area**2 * (geometry.slope**2).sum(axis=0)
    return float(WEIGHTS @ (RUBBER.area * (RUBBER.energy(geometry.forms()) + shear)))


def difference(function, control=DEFORMED, shift=SHIFT):
    """Derivative of a function of the control values along a shift."""
    return (function(control + STEP * shift) - function(control - STEP * shift)) / (2 * STEP)


def volume(control) -> float:
    """Between the wall and the origin; not a polynomial that the quadrature takes exactly."""
    points = BASIS.of(control)[:, :3]
    along, around = BASIS.of(control, 2)[:, :3], BASIS.of(control, 1)[:, :3]
    return float(WEIGHTS @ (points * np.cross(along, around)).sum(axis=1) / 3)


def inner_face(control):
    geometry = Geometry.of(BASIS, control)
    depth = RUBBER.layer(geometry.forms(), -0.5).depth_mm
    return BASIS.of(control)[:, :3] + depth[:, np.newaxis] * geometry.director()


def inner_share(control):
    """Area of the inner face per area of the parameters."""
    geometry = Geometry.of(BASIS, control)
    depth = RUBBER.layer(geometry.forms(), -0.5).depth_mm
    return geometry.area * inner_area(geometry.forms(), depth)


def summed(shell: Shell, stiffness):
    """(4 K, 4 K) matrix of a wall, of stiffness by derivatives and unknowns at its points."""
    points, count = len(shell.weights), int(shell.basis.members.max()) + 1
    by_control = np.zeros((points, 24, 4 * count))
    for derivative in range(6):
        dense = shell.basis.matrices[derivative].toarray()
        for unknown in range(4):
            by_control[:, 4 * derivative + unknown, unknown::4] = dense
    weighted = shell.weights[:, np.newaxis, np.newaxis] * stiffness @ by_control
    return np.tensordot(by_control, weighted, axes=((0, 1), (0, 1)))


def test_a_tube_has_the_geometry_of_its_formula():
    geometry = Geometry.of(BASIS, TUBE)
    outward = np.stack([np.zeros(COUNT), np.sin(S / RADIUS), np.cos(S / RADIUS)], axis=1)
    assert geometry.normal == pytest.approx(outward, abs=5e-3)
    assert geometry.area == pytest.approx(np.ones(COUNT), abs=5e-3)
    forms = geometry.forms()
    assert forms.metric[1] == pytest.approx(np.ones(COUNT))
    assert forms.metric[2] == pytest.approx(np.zeros(COUNT), abs=1e-9)
    assert forms.curvature[0] == pytest.approx(np.full(COUNT, 1 / RADIUS), rel=0.05)
    assert forms.curvature[1:] == pytest.approx(np.zeros((2, COUNT)), abs=1e-9)


def test_dual_tangents_belong_to_the_tangents():
    geometry = Geometry.of(BASIS, DEFORMED)
    products = np.einsum("ani,bni->abn", geometry.dual, geometry.tangents)
    assert products == pytest.approx(np.broadcast_to(np.eye(2)[..., np.newaxis], (2, 2, COUNT)))
    assert np.einsum("ani,ni->an", geometry.dual, geometry.normal) == pytest.approx(np.zeros((2, COUNT)))


def test_forms_and_normal_follow_the_derivatives_of_the_control_values():
    geometry = Geometry.of(BASIS, DEFORMED)
    by_derivative = np.stack([BASIS.of(SHIFT, derivative) for derivative in range(1, 6)])
    forms = np.einsum("endc,dnc->en", geometry.forms_by_values(), by_derivative)
    numeric = difference(lambda control: np.concatenate(Geometry.of(BASIS, control).forms()))
    assert forms == pytest.approx(numeric, abs=1e-7)
    normal = np.einsum("nilj,lnj->ni", geometry.normal_by_tangents(), by_derivative[:2, :, :3])
    numeric = difference(lambda control: Geometry.of(BASIS, control).normal)
    assert normal == pytest.approx(numeric, abs=1e-7)


def test_shear_alone_neither_bends_the_wall_nor_turns_its_sections():
    # A wall that sinks by s where shear alone lowers it by s keeps its sections as they were.
    plane = control_of(GRID, np.stack([X, S, np.zeros(COUNT)], axis=1))
    sheared = plane.copy()
    sheared[:, 2] += 0.01 * np.random.default_rng(3).normal(size=GRID.count)
    sheared[:, 3] = sheared[:, 2]
    geometry = Geometry.of(BASIS, sheared)
    assert geometry.forms().curvature == pytest.approx(np.zeros((3, COUNT)), abs=1e-5)
    assert geometry.director()[:, :2] == pytest.approx(np.zeros((COUNT, 2)), abs=1e-5)
    assert np.abs(geometry.normal[:, :2]).max() > 1e-3


def test_force_is_the_loss_of_energy():
    assert (SHELL.force(DEFORMED, FREE) * SHIFT).sum() == pytest.approx(-difference(energy), rel=1e-8)


@settings(max_examples=10, deadline=None)
@given(st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6))
def test_a_wall_that_moves_as_a_whole_bears_nothing(motion):
    turn = Rotation.from_rotvec(motion[:3])
    moved = np.column_stack([turn.apply(TUBE[:, :3]) + motion[3:], TUBE[:, 3]])
    assert SHELL.force(moved, FREE) == pytest.approx(np.zeros(TUBE.shape), abs=1e-9)


def test_forces_turn_with_the_wall():
    turn = Rotation.from_rotvec([0.3, -1.0, 0.5])
    load = Load(0.03, PRESSED.contact_mpa, np.full((2, COUNT), 0.004))
    force = SHELL.force(DEFORMED, load)
    turned = np.column_stack([turn.apply(DEFORMED[:, :3]), DEFORMED[:, 3]])
    expected = np.column_stack([turn.apply(force[:, :3]), force[:, 3]])
    assert SHELL.force(turned, load) == pytest.approx(expected, abs=1e-9)


def test_pressure_difference_works_on_the_volume_inside():
    work = SHELL.force(DEFORMED, Load(0.03, np.zeros(COUNT), NO_TRACTION)) - SHELL.force(DEFORMED, FREE)
    swept = difference(volume, shift=inside(SHIFT))
    # Two points per interval round are few for a wall as rough as this one.
    assert (work * inside(SHIFT)).sum() == pytest.approx(-0.03 * swept, rel=5e-3)


def test_contact_pressure_works_on_the_normal_movement_of_the_inner_face():
    shift = inside(noise(4, 1.0, 0.0))
    work = SHELL.force(TUBE, Load(0.0, PRESSED.contact_mpa, NO_TRACTION)) - SHELL.force(TUBE, FREE)
    moved = (difference(inner_face, TUBE, shift) * Geometry.of(BASIS, TUBE).normal).sum(axis=1)
    expected = WEIGHTS @ (PRESSED.contact_mpa * inner_share(TUBE) * moved)
    assert (work * shift).sum() == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("direction", [0, 1], ids=["round", "along"])
def test_traction_works_on_the_movement_of_the_inner_face(direction):
    traction = np.zeros((2, COUNT))
    traction[direction] = 0.01 * np.sin(X / 7 + S / 3)
    work = SHELL.force(TUBE, Load(0.0, np.zeros(COUNT), traction)) - SHELL.force(TUBE, FREE)
    tangent = Geometry.of(BASIS, TUBE).tangents[direction]
    unit = tangent / np.linalg.norm(tangent, axis=1, keepdims=True)
    moved = (difference(inner_face, TUBE) * unit).sum(axis=1)
    expected = WEIGHTS @ (traction[direction] * inner_share(TUBE) * moved)
    assert (work * SHIFT).sum() == pytest.approx(expected, rel=1e-6)


def test_unit_loads_add_up_to_the_force():
    traction = np.stack([0.01 * np.sin(S), 0.02 * np.cos(X)])
    load = Load(0.0, PRESSED.contact_mpa, traction)
    work = np.einsum("ndcl,nl->ndc", SHELL.work(DEFORMED).units, load.by_units())
    expected = SHELL.force(DEFORMED, load) - SHELL.force(DEFORMED, FREE)
    assert SHELL.gathered(work[..., np.newaxis])[..., 0] == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize("load", [FREE, Load(0.03, np.zeros(COUNT), NO_TRACTION), PRESSED])
def test_stiffness_is_the_loss_of_force(load):
    predicted = summed(SHELL, SHELL.stiffness(DEFORMED, load)) @ SHIFT.ravel()
    numeric = difference(lambda control: SHELL.force(control, load)).ravel()
    assert predicted == pytest.approx(-numeric, abs=1e-8 * np.abs(numeric).max())


def test_stiffness_without_load_is_symmetric():
    matrix = summed(SHELL, SHELL.stiffness(DEFORMED, FREE))
    assert matrix == pytest.approx(matrix.T, abs=1e-12)


def test_traction_changes_the_stiffness_by_no_more_than_its_share():
    load = Load(0.0, np.zeros(COUNT), np.full((2, COUNT), 0.005))
    predicted = summed(SHELL, SHELL.stiffness(DEFORMED, load)) @ SHIFT.ravel()
    numeric = -difference(lambda control: SHELL.force(control, load)).ravel()
    assert np.linalg.norm(predicted - numeric) < 0.005 / SHEAR * np.linalg.norm(numeric)


@pytest.mark.parametrize("stretches", [(1.0, 1.0), (0.95, 1.1), (1.3, 1.1)])
@pytest.mark.parametrize("direction", [0, 1], ids=["round", "along"])
def test_normals_of_a_stretched_wall_tilt_against_the_shear_of_the_solid(stretches, direction):
    one, other = stretches
    thinned = 1 / (one * other)
    ones = np.ones(COUNT)
    rest = Forms(np.outer([one**-2, other**-2, 0.0], ones), np.zeros((3, COUNT)))
    shell = Shell(BASIS, WEIGHTS, RubberWall(rest, WALL * ones, SHEAR))

    def solid(tilt: float) -> float:
        """Energy of the rubber, by I₁ of what becomes of edges round, along and across the wall."""
        across = thinned * np.eye(3)[2] + thinned * tilt * np.eye(3)[direction]
        gradient = np.stack([one * np.eye(3)[0], other * np.eye(3)[1], across])
        volume = WEIGHTS.sum() * WALL / (one * other)
        return SHEAR / 2 * (gradient**2).sum() * volume

    tilt = 0.01
    plane = control_of(GRID, np.stack([X, S, np.zeros(COUNT)], axis=1))
    tilting = np.zeros(TUBE.shape)
    tilting[:, 3] = control_of(GRID, np.stack([S, X, np.zeros(COUNT)], axis=1))[:, direction]
    work = (shell.force(plane + tilt * tilting, FREE) * tilting).sum()
    slope = (solid(tilt + STEP) - solid(tilt - STEP)) / (2 * STEP)
    assert work == pytest.approx(-SHEAR_SHARE * slope, rel=1e-6)


@pytest.mark.parametrize("span_over_wall", [4.0, 8.0, 40.0])
def test_a_clamped_strip_sags_by_bending_and_by_shear(span_over_wall):
    span, pressure = span_over_wall * WALL, 1e-6
    grid = SplineGrid(SplineAxis.over(0.0, 1.0, 4), SplineAxis.over(0.0, span, 12))
    s, x, weights = grid.quadrature()
    flat = Forms(np.outer([1.0, 1.0, 0.0], np.ones(len(s))), np.zeros((3, len(s))))
    shell = Shell(grid.basis(s, x), weights, RubberWall(flat, np.full(len(s), WALL), SHEAR))
    plane = control_of(grid, np.stack([x, s, np.zeros(len(s))], axis=1))
    load = Load(pressure, np.zeros(len(s)), np.zeros((2, len(s))))
    free = clamped_strip(grid)
    matrix = free.T @ summed(shell, shell.stiffness(plane, load)) @ free
    sunk = free @ np.linalg.solve(matrix, free.T @ shell.force(plane, load).ravel())
    sag = -grid.basis(np.array([0.5]), np.array([span / 2])).of(sunk.reshape(-1, 4))[0, 2]
    bending = pressure * span**4 / 384 / (SHEAR * WALL**3 / 3)
    shear = pressure * span**2 / 8 / (SHEAR_SHARE * SHEAR * WALL)
    assert sag == pytest.approx(bending + shear, rel=1e-3)


def clamped_strip(grid: SplineGrid):
    """Control values of z and s that do not vary across a strip, with ends that neither sink nor tilt."""
    rows = grid.along.count
    strip = np.zeros((rows, grid.around.count, 4, rows, 2))
    for row in range(1, rows - 1):
        # Beside an end z and s are alike, because a section's tilt is that of z − s.
        strip[row, :, 2, row, 0] = 1
        strip[row, :, 3, row, 0 if row in (1, rows - 2) else 1] = 1
    strip = strip.reshape(4 * grid.count, -1)
    return strip[:, strip.any(axis=0)]
