"""The pressure map: its σ and what it is made of, and where it says nothing."""

from functools import lru_cache

import numpy as np
import pytest

from analysis.collapsing import grid, outer
from analysis.shapes import cylinder
from analysis.wall.test_material import rubber
from grabberd.analysis import ChamberVacuum, PressureModel, Zone, fit_surface
from grabberd.errors import AnalysisError
from grabberd.reconstruction import Points

SOUGHT_KPA = 5.0
QUIET = ChamberVacuum(42.0, 42.0, 0.1, 0.1)


def points(closed, sigma_mm=0.01, seed=0, kept=None):
    kept = np.arange(108) if kept is None else kept
    noise = np.random.default_rng(seed).normal(size=(108, 3)) * sigma_mm
    xyz = (outer(grid().row.astype(float), grid().column.astype(float), closed) + noise)[kept]
    n, covariance = len(kept), np.tile(np.eye(3) * sigma_mm**2, (len(kept), 1, 1))
    zeros = np.zeros((n, 3, 3))
    return Points(grid().target[kept], xyz, covariance, zeros, np.zeros((n, 2, 2)), np.zeros(n))


@lru_cache
def surface(closed, sigma_mm=0.01, seed=0):
    return fit_surface(grid(), points(closed, sigma_mm, seed))


def model(material=None, reference=None, sought_kpa=SOUGHT_KPA):
    places = (grid().u_mm, grid().v_mm)
    before = surface(0.0).base(*places) if reference is None else reference
    zones = [Zone(-10.0, 200.0, material or rubber(target_mm=0.0))]
    return PressureModel.of(zones, places, before, grid().outward, sought_kpa)


def test_the_open_liner_presses_nowhere_within_sigma():
    result = model().map(surface(0.0), QUIET)
    use = result.usable
    assert use.sum() > 60
    assert np.mean((result.contact_kpa.value / result.contact_kpa.sigma)[use] ** 2) < 2.0


def test_the_load_above_atmosphere_is_the_contact_pressure_less_the_liner_s_vacuum():
    result = model().map(surface(0.3), QUIET)
    assert result.overpressure_kpa.value == pytest.approx(result.contact_kpa.value - 42.0)


def test_sigma_is_what_its_shares_make():
    material = rubber(target_mm=0.0, E_sigma_mpa=0.2, wall_sigma_mm=0.05, F0_sigma_n=3.0)
    vacuum = ChamberVacuum(20.0, 42.0, 0.3, 0.2, pulsation_slope_kpa_per_s=-280.0, time_sigma_s=2e-3)
    result = model(material).map(surface(0.3), vacuum)
    shares = result.shares
    squares = shares.points_kpa**2 + (shares.common_kpa**2).sum(axis=0)
    assert result.contact_kpa.sigma == pytest.approx(np.sqrt(squares))
    assert (np.abs(shares.material_kpa).max(axis=1) > 0).all()
    assert shares.time_kpa / shares.pulsation_kpa == pytest.approx(np.full(108, -280 * 2e-3 / 0.3))


def test_an_offset_of_the_clocks_counts_by_how_fast_the_vacuum_changes():
    """10 ms at 45 kPa in 150 ms are 3 kPa."""
    vacuum = ChamberVacuum(20.0, 42.0, 0.0, 0.0, pulsation_slope_kpa_per_s=-300.0, time_sigma_s=1e-2)
    shares = model().map(surface(0.0), vacuum).shares
    assert shares.time_kpa == pytest.approx(np.full(108, 3.0 / 0.9), rel=0.02)


def test_a_share_of_the_material_is_what_one_sigma_of_it_changes():
    plain, stiff = rubber(target_mm=0.0, E_sigma_mpa=0.2), rubber(target_mm=0.0, E_mpa=3.2)
    first, second = (model(m).map(surface(0.3), QUIET) for m in (plain, stiff))
    assert first.shares.material_kpa[0] == pytest.approx(second.contact_kpa.value - first.contact_kpa.value)
    assert not first.shares.material_kpa[1:].any()


def test_a_vacuum_in_the_liner_that_is_badly_known_hardly_matters_above_atmosphere():
    result = model().map(surface(0.3), ChamberVacuum(0.0, 42.0, 0.0, 3.0))
    assert np.median(result.overpressure_kpa.sigma / result.contact_kpa.sigma) < 1.0
    assert np.median(np.abs(result.shares.liner_kpa)) > 3.0


def test_a_measured_reference_brings_its_own_sigma():
    reference = surface(0.0, 0.01, 1)
    measured = model(reference=reference).map(surface(0.3), QUIET)
    exact = model(reference=reference.jets(grid().u_mm, grid().v_mm)).map(surface(0.3), QUIET)
    assert measured.contact_kpa.value == pytest.approx(exact.contact_kpa.value)
    assert (measured.shares.points_kpa > exact.shares.points_kpa).all()


def test_the_points_share_is_what_the_surface_s_own_propagation_gives():
    the_model = model()
    result = the_model.map(surface(0.3), QUIET)
    expected = surface(0.3).propagate(
        lambda jets: np.stack(
            [
                the_model.equilibrium.contact_kpa(the_model.equilibrium.shape(one), QUIET.difference_kpa)
                for one in jets.reshape(-1, *jets.shape[-3:])
            ]
        ).reshape(jets.shape[:-2]),
        grid().u_mm,
        grid().v_mm,
    )
    assert result.shares.points_kpa == pytest.approx(expected.sigma, rel=1e-3)
    assert result.contact_kpa.value == pytest.approx(expected.value)


def test_where_sigma_exceeds_the_pressure_the_map_says_nothing_and_why():
    result = model(sought_kpa=0.5).map(surface(0.3), QUIET)
    said = [reason for reason in result.reason if reason]
    assert said
    assert all("exceeds the pressure sought" in reason for reason in said)
    refused = ~result.usable
    signal = np.maximum(np.abs(result.contact_kpa.value), 0.5)
    assert np.array_equal(refused, result.contact_kpa.sigma > signal)


def test_where_no_targets_are_near_the_map_says_so():
    hole = np.flatnonzero((grid().row < 5) | (grid().row > 8) | (grid().column > 2))
    result = model().map(fit_surface(grid(), points(0.3, kept=hole)), QUIET)
    inside = np.setdiff1d(np.arange(108), hole)
    assert {result.reason[place] for place in inside} == {"no targets near enough"}


def test_where_nothing_is_left_the_analysis_says_what_is_lacking():
    vague = ChamberVacuum(42.0, 42.0, 500.0, 0.0)
    with pytest.raises(AnalysisError, match=r"none of 108 places .*median σ 5\.\de\+02 kPa") as caught:
        model().map(surface(0.3), vague)
    assert "more bits" in caught.value.hint


def test_a_face_curved_more_sharply_than_the_wall_is_thick_is_refused():
    places = (grid().u_mm[:3], grid().v_mm[:3])
    zones = [Zone(-10.0, 200.0, rubber(wall_mm=5.0))]
    sharp = PressureModel.of(zones, places, cylinder(13.75, *places), 1.0, SOUGHT_KPA)
    with pytest.raises(AnalysisError, match="curved more sharply than the wall is thick"):
        sharp.map(_Round(cylinder(2.0, *places)), QUIET)


class _Round:
    """A surface of one shape without σ."""

    def __init__(self, jets):
        self._jets = jets

    def jets(self, u_mm, v_mm):
        return self._jets

    def within(self, u_mm, v_mm):
        return np.ones(len(u_mm), bool)

    def sigma(self, slopes, u_mm, v_mm):
        return np.zeros(len(u_mm))


def test_a_surface_of_another_capture_s_zone_is_refused_by_its_place():
    with pytest.raises(AnalysisError, match="in no zone of the material"):
        PressureModel.of(
            [Zone(0.0, 50.0, rubber())],
            (grid().u_mm, grid().v_mm),
            surface(0.0).base(grid().u_mm, grid().v_mm),
            1.0,
            SOUGHT_KPA,
        )
