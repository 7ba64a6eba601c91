"""The outer face of the wall in equilibrium: against walls that were solved as solids, with σ."""

import numpy as np
import pytest

from grabberd_liner.analysis.load.load_fit import posterior
from grabberd_liner.analysis.load.pressure import ChamberVacuum, PressureModel
from grabberd_liner.analysis.load.targets import TargetPlaces
from grabberd_liner.analysis.surface.sections import (
    Plane,
    sections,
    supported_places,
    surface_area,
    volume_mm3,
)
from liner.analysis.solved_face import SolvedFace
from liner.analysis.walls import as_points, solved

NAME = "reference-round"
DIFFERENCES_KPA = (6.0, 16.0, 24.0, 30.0)
HEIGHTS_MM = (-30.0, 0.0, 25.0)
PLANE = Plane(np.zeros(3), np.array([0.0, 0.0, 1.0]))


class Case:
    """Walls that were fitted to fields of a solved liner, with their faces."""

    def __init__(self):
        self.liner = solved(NAME)
        self.grid = self.liner.grid
        reference = as_points(self.liner.places_mm(0.0), np.full(3, 0.005))
        self.model = PressureModel(self.grid, self.liner.zones(), reference, 50.0)
        self.walls = [self.settled(kpa, seed) for seed, kpa in enumerate(DIFFERENCES_KPA)]
        self.faces = [self.face(wall) for wall in self.walls]
        self.true = [SolvedFace(self.liner, kpa) for kpa in DIFFERENCES_KPA]

    def settled(self, kpa, seed, points=None):
        points = self.liner.points(kpa, seed) if points is None else points
        return self.model.settled(points, ChamberVacuum(42.0 - kpa, 42.0, 0.35, 0.35))

    def face(self, wall, seen=None):
        seen = np.arange(len(self.grid)) if seen is None else seen
        return self.model.face(wall, supported_places(self.grid, seen), ())


@pytest.fixture(scope="module")
def case():
    return Case()


def compared(found, true):
    """Root mean square error, and χ²."""
    values, sigmas = (
        np.array([getattr(one, part) for one in found], np.float64) for part in ("value", "sigma")
    )
    off = values - np.array(true)
    return np.sqrt(np.mean(off**2)), np.mean((off / sigmas) ** 2)


def test_the_lattice_follows_the_face_between_its_nodes(case):
    u, v = (part.ravel() for part in np.meshgrid(np.linspace(1, 109, 60), np.linspace(0.5, 19, 30)))
    mounting = case.model._mounting
    nominal = mounting.targets
    # Targets glued exactly in rows and columns: material coordinates are then lengths on the mounted wall.
    s_mm = np.interp(v, case.grid.v_mm[:4], nominal.s_mm[:4])
    x_mm = np.interp(u, case.grid.u_mm[::4], nominal.x_mm[::4])
    for wall, face in zip(case.walls, case.faces, strict=True):
        half = wall.found.model.half.of(wall.found.model.tube(wall.found.parameters))
        places = TargetPlaces(mounting.half, nominal._replace(s_mm=s_mm, x_mm=x_mm))
        exact = mounting.frame.origin_mm + places.places_mm(half, wall.found.control) @ mounting.frame.axes
        assert np.abs(face.tangents(u, v)[:, 0] - exact)[:, 2].max() < 0.01


def test_tangents_are_derivatives_of_the_points(case):
    u, v, step = np.array([20.0, 55.0, 90.0]), np.array([3.0, 9.0, 17.0]), 1e-4
    face = case.faces[-1]
    tangents = face.tangents(u, v)
    for index, (du, dv) in enumerate(((step, 0.0), (0.0, step)), 1):
        ahead, behind = face.tangents(u + du, v + dv)[:, 0], face.tangents(u - du, v - dv)[:, 0]
        assert tangents[:, index] == pytest.approx((ahead - behind) / (2 * step), abs=1e-6)


def test_points_at_the_targets_are_the_solid_s_and_nearer_than_what_was_measured(case):
    at = case.grid.u_mm, case.grid.v_mm
    ratios = []
    for face, kpa in zip(case.faces, DIFFERENCES_KPA, strict=True):
        found = face.places_mm(*at)
        off = found.value - case.liner.places_mm(kpa)
        assert np.sqrt(np.mean(off[:, 2] ** 2)) < 0.8 * 0.026
        ratios.append((off / found.sigma) ** 2)
    assert 0.4 < np.mean(ratios) < 1.4


@pytest.mark.parametrize(
    ("name", "within"), [("length_mm", 0.03), ("chord_mm", 0.03), ("distance_mm", 0.04), ("area_mm2", 0.5)]
)
def test_sections_are_the_solid_s_with_a_sigma_that_holds(case, name, within):
    found, true = [], []
    for face, truth in zip(case.faces, case.true, strict=True):
        some, missed = sections(face, HEIGHTS_MM, PLANE)
        assert not missed
        found += [getattr(one, name) for one in some]
        true += [getattr(truth.outline(height), name) for height in HEIGHTS_MM]
    rms, chi2 = compared(found, true)
    assert rms < within
    assert chi2 < 2.5


def test_area_and_volume_are_the_solid_s(case):
    ends = HEIGHTS_MM[0], HEIGHTS_MM[-1]
    areas = [surface_area(face).area_mm2 for face in case.faces]
    assert compared(areas, [true.area_mm2() for true in case.true])[1] < 4
    volumes = [volume_mm3(face, ends, PLANE) for face in case.faces]
    rms, chi2 = compared(volumes, [true.volume_mm3(*ends) for true in case.true])
    # What a smooth surface makes of the same points of a closed wall is wrong by 65 mm³.
    assert rms < 15
    assert chi2 < 4


def test_a_target_that_the_others_contradict_is_left_out(case):
    points = case.liner.points(24.0, 5)
    wrong = points.xyz_mm.copy()
    wrong[30, 2] += 1.0
    wall = case.settled(24.0, 5, as_points(wrong, np.array([0.010, 0.010, 0.026])))
    assert wall.left_out == (30,)
    assert not wall.contradicted
    off = case.face(wall).places_mm(case.grid.u_mm, case.grid.v_mm).value[30] - points.xyz_mm[30]
    assert np.abs(off).max() < 0.2


def test_how_far_a_target_is_outlying_is_told_by_a_fit_without_it(case):
    found = case.walls[1].found
    for target in (7, 40):
        told = posterior(found.response, found.sights.without(target), found.difference)
        place, covariance = told.places_mm[target], told.places_covariance(case.model._mounting.shared_mm2)
        own = slice(3 * target, 3 * target + 3)
        away = found.sights.value[own] - place
        # What is shared with the other targets is part of both, and left out here.
        noise = found.sights.covariance[own, own] - case.model._mounting.shared_mm2[own, own]
        chi2 = away @ np.linalg.solve(covariance[own, own] + noise, away)
        assert found.outlying[target] == pytest.approx(chi2, rel=0.1, abs=0.05)


def test_places_far_from_what_was_seen_are_not_supported(case):
    seen = np.flatnonzero(case.grid.row < 9)
    face = case.face(case.walls[0], seen)
    within = face.within(case.grid.u_mm, case.grid.v_mm)
    assert within[case.grid.row < 9].all()
    assert not within[case.grid.row > 10].any()
    assert surface_area(face).covered < 0.6
