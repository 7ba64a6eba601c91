"""The half tube: closed forms, convergence, and agreement with walls that were solved as solids."""

import numpy as np
import pytest

from grabberd_fake.wall_states import wall_states
from grabberd_liner.analysis.wall.half_tube import HalfTube, MountedTube
from grabberd_liner.analysis.wall.rubber import Forces
from grabberd_liner.analysis.wall.shell import Load
from liner.analysis.wall.half_tubes import SolvedWall, load, outer_face, settled

TUBE = MountedTube(
    radius_mm=12.5, taper=0.0, length_mm=130.0, thickness_mm=2.5, young_mpa=3.0, pretension_n=60.0
)
SHORT = MountedTube(12.5, 0.01, 60.0, 2.5, 3.0, 60.0)
SHEAR = TUBE.young_mpa / 3


@pytest.fixture(scope="module")
def half() -> HalfTube:
    return HalfTube(TUBE)


@pytest.fixture(scope="module")
def coarse() -> HalfTube:
    return HalfTube(SHORT, arcs=6, slabs=8)


@pytest.fixture(scope="module")
def bent(coarse):
    """A state that is out of equilibrium everywhere."""
    return coarse.moved(coarse.mounted, 0.05 * np.random.default_rng(1).normal(size=coarse.cuts.count))


@pytest.fixture(scope="module")
def uneven(coarse) -> Load:
    return load(coarse, 0.01, 0.02 + 0.01 * np.sin(coarse.s_mm))


def pinched(half: HalfTube) -> Load:
    """Pressure on a spot, and outside."""
    return load(half, 0.006, 0.02 * np.exp(-((half.s_mm / 6) ** 2) - (half.x_mm / 12) ** 2))


@pytest.mark.parametrize("pretension_n", [0.0, 30.0, 60.0, 120.0])
def test_the_mounted_stretch_pulls_with_the_pretension(pretension_n):
    tube = MountedTube(12.5, 0.0, 130.0, 2.5, 3.0, pretension_n)
    section_mm2 = 2 * np.pi * 12.5 * 2.5
    pull = SHEAR * (tube.stretch**2 - 1 / tube.stretch) * section_mm2
    assert pull == pytest.approx(pretension_n, abs=1e-9)


def test_changes_are_powers_of_e():
    changed = TUBE.changed(young=0.1, thickness=-0.2, pretension=0.3)
    assert changed.young_mpa == pytest.approx(3.0 * np.exp(0.1))
    assert changed.thickness_mm == pytest.approx(2.5 * np.exp(-0.2))
    assert changed.pretension_n == pytest.approx(60.0 * np.exp(0.3))
    assert (changed.radius_mm, changed.taper, changed.length_mm) == (12.5, 0.0, 130.0)


def test_the_mounted_wall_is_the_tube(half):
    points = half.shell.basis.of(half.mounted)
    theta = half.s_mm / 12.5
    expected = np.stack([half.x_mm, 12.5 * np.sin(theta), 12.5 * np.cos(theta)], axis=1)
    assert points[:, :3] == pytest.approx(expected, abs=1e-4)
    assert not points[:, 3].any()


def test_a_tapered_tube_is_wider_at_low_x():
    half = HalfTube(SHORT, arcs=8, slabs=6)
    points = half.shell.basis.of(half.mounted)
    assert np.hypot(points[:, 1], points[:, 2]) == pytest.approx(12.5 - 0.01 * half.x_mm, abs=1e-3)


def test_a_departure_is_added_to_the_radius():
    ideal = HalfTube(TUBE, arcs=8, slabs=6)
    departure = 0.05 * np.random.default_rng(2).normal(size=ideal.grid.count)
    basis = ideal.shell.basis
    points = basis.of(HalfTube(TUBE, departure, arcs=8, slabs=6).mounted)
    expected = 12.5 + basis.of(departure)
    assert np.sqrt(np.mean((np.hypot(points[:, 1], points[:, 2]) - expected) ** 2)) < 2e-3


def test_the_mounted_tube_is_in_equilibrium_and_pulls_at_its_ends(half):
    free = load(half, 0.0)
    assert half.residual(half.mounted, free) == pytest.approx(np.zeros(half.cuts.count), abs=1e-9)
    force = half.shell.force(half.mounted, free)[:, 0].reshape(half.grid.along.count, -1).sum(axis=1)
    assert [force[0], force[-1]] == pytest.approx([30.0, -30.0], rel=1e-5)


def test_a_tube_snug_on_a_mandrel_stays_as_it_is(half):
    control = settled(half, half.mounted, load(half, 0.042, 0.042))
    moved = outer_face(half, control) - outer_face(half, half.mounted)
    assert np.abs(moved).max() < 1e-3


def test_a_tube_snug_on_a_mandrel_presses_on_it_with_the_whole_difference(half):
    # Force per contact pressure, and that of the pressure outside: their ratio is the contact pressure.
    free, outside, contact = (
        half.residual(half.mounted, load(half, *pressures)) for pressures in ((0, 0), (0.042, 0), (0, 1))
    )
    per_contact = contact - free
    recovered = -per_contact @ (outside - free) / (per_contact @ per_contact)
    assert recovered == pytest.approx(0.042, rel=1e-4)
    assert np.linalg.norm(outside - free + recovered * per_contact) < 1e-3 * np.linalg.norm(outside - free)


@pytest.mark.parametrize("thickness_mm", [0.5, 1.0])
def test_a_long_thin_tube_buckles_at_3d_over_r_cubed(thickness_mm):
    tube = MountedTube(12.5, 0.0, 2000.0, thickness_mm, 3.0, 0.0)
    half = HalfTube(tube, arcs=12, slabs=20)
    critical_mpa = 3 * (SHEAR * thickness_mm**3 / 3) / 12.5**3
    units = half.shell.work(half.mounted).units[..., 1:2]
    push = half.gathered(units * np.cos(2 * half.s_mm / 12.5)[:, np.newaxis, np.newaxis, np.newaxis])[:, 0]

    def stiffness(share: float) -> float:
        under = load(half, share * critical_mpa)
        tangent = half.tangent(settled(half, half.mounted, under), under)
        return float(1 / (push @ tangent.factors.solve(push)))

    low, high = stiffness(0.8), stiffness(0.9)
    # It falls in proportion to the pressure, and is zero when the tube buckles.
    assert 0.9 + 0.1 * high / (low - high) == pytest.approx(1.0, abs=0.015)


def test_finer_meshes_agree():
    s, x = (grid.ravel() for grid in np.meshgrid(np.linspace(-18, 18, 13), np.linspace(-25, 25, 11)))
    faces = []
    for arcs, slabs in ((8, 6), (16, 12), (24, 18)):
        mesh = HalfTube(SHORT, arcs=arcs, slabs=slabs)
        control = settled(mesh, mesh.mounted, pinched(mesh))
        faces.append(outer_face(mesh, control, mesh.grid.basis(s, x)))
    coarse, fine = (np.abs(face - faces[-1]).max() for face in faces[:-1])
    assert fine < 0.01
    assert fine < coarse / 4


def test_a_stiffer_tube_under_as_much_more_load_takes_the_same_shape(coarse):
    control = settled(coarse, coarse.mounted, pinched(coarse))
    stiffer = coarse.of(SHORT.changed(young=np.log(2), thickness=0.0, pretension=np.log(2)))
    under = pinched(coarse)
    doubled = Load(2 * under.difference_mpa, 2 * under.contact_mpa, under.traction_mpa)
    assert settled(stiffer, stiffer.mounted, doubled) == pytest.approx(control, abs=1e-6)


def test_a_larger_tube_under_the_same_pressure_takes_the_same_shape(coarse):
    control = settled(coarse, coarse.mounted, pinched(coarse))
    larger = HalfTube(MountedTube(25.0, 0.01, 120.0, 5.0, 3.0, 240.0), arcs=6, slabs=8)
    same = load(larger, 0.006, pinched(coarse).contact_mpa)
    assert settled(larger, larger.mounted, same) == pytest.approx(2 * control, abs=1e-5)


def test_another_tube_on_the_same_mesh_is_that_tube(coarse, bent, uneven):
    tube = SHORT.changed(0.1, 0.05, 0.2)
    expected = HalfTube(tube, arcs=6, slabs=8).residual(bent, uneven)
    assert coarse.of(tube).residual(bent, uneven) == pytest.approx(expected, abs=1e-10)
    assert coarse.tube == SHORT


def test_the_tangent_is_the_loss_of_force(coarse, bent, uneven):
    direction, step = np.random.default_rng(3).normal(size=coarse.cuts.count), 1e-6
    high, low = (coarse.residual(coarse.moved(bent, side * direction), uneven) for side in (step, -step))
    loss = (low - high) / (2 * step)
    tangent = coarse.tangent(bent, uneven)
    assert tangent.factors.solve(loss) == pytest.approx(direction, abs=1e-5)


def test_cuts_that_move_load_the_wall_by_the_tangent_of_what_is_held(coarse, bent, uneven):
    moved = coarse.cuts.moved
    values, step = np.random.default_rng(4).normal(size=moved.shape[1]), 1e-6
    shift = step * (moved @ values).reshape(bent.shape)
    loss = (coarse.residual(bent - shift, uneven) - coarse.residual(bent + shift, uneven)) / (2 * step)
    by_held = coarse.tangent(bent, uneven).by_held(moved)
    assert by_held @ values == pytest.approx(loss, abs=1e-6 * np.abs(loss).max())


def test_fields_of_load_act_as_their_values_do(coarse, bent):
    fields = 0.01 * np.random.default_rng(5).normal(size=(3, coarse.grid.count))
    shell = coarse.shell
    forces = Forces(
        coarse.rows, coarse.by_fields(shell.work(bent).units[..., 1:]), np.zeros((coarse.cuts.count, 0))
    )
    contact, around, along = (shell.basis.of(field) for field in fields)
    loaded = coarse.residual(bent, Load(0.0, contact, np.stack([around, along])))
    expected = loaded - coarse.residual(bent, load(coarse, 0.0))
    assert forces.of(fields.ravel()) == pytest.approx(expected, abs=1e-10)


@pytest.fixture(scope="module")
def on_a_teat() -> SolvedWall:
    return SolvedWall(wall_states("reference-round"))


def state_kpa(wall: SolvedWall, contact_kpa: float) -> float:
    """Highest solved pressure difference at which the teat is nowhere pressed by more than that."""
    states = wall.states.outer_kpa
    return float(max(outer for outer in states if wall.states.contact_kpa(outer).max() <= contact_kpa))


def rms_mm(departure) -> float:
    return float(np.sqrt(np.mean(departure**2)))


def test_the_mounted_wall_is_that_of_the_table(on_a_teat):
    half = on_a_teat.half
    assert rms_mm(outer_face(half, half.mounted) - on_a_teat.face(0.0)[0]) < 0.005


@pytest.mark.parametrize(
    ("contact_kpa", "within_mm"), [(0.1, 0.01), (2.0, 0.02), (30.0, 0.04), (100.0, 0.06)]
)
def test_a_wall_under_the_tables_pressures_takes_the_tables_shape(on_a_teat, contact_kpa, within_mm):
    outer_kpa = state_kpa(on_a_teat, contact_kpa)
    assert rms_mm(on_a_teat.departure_mm(outer_kpa)) < within_mm


def test_an_empty_liner_that_has_buckled_takes_the_tables_shape():
    wall = SolvedWall(wall_states("reference-empty"))
    outer_kpa = state_kpa(wall, 0.0)
    stroke = np.abs(wall.face(outer_kpa)[0] - wall.face(0.0)[0]).max()
    assert stroke > 3.0
    assert rms_mm(wall.departure_mm(outer_kpa)) < 0.01 * stroke
