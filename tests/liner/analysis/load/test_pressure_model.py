"""The pressure map: against walls that were solved as solids, with σ, refusals and reasons."""

import numpy as np
import pytest

from grabberd.errors import AnalysisError
from grabberd_liner.analysis.load.load_profile import teat_heights
from grabberd_liner.analysis.load.pressure import ChamberVacuum, PressureModel
from grabberd_liner.analysis.wall.material import Zone
from liner.analysis.walls import (
    EIGHT_BITS_MM,
    as_points,
    outermost_alone,
    pressure_map,
    rig,
    solved,
    solved_six,
)

SOUGHT_KPA = 50.0
"""Beyond every σ: nothing is refused for it."""
SEEN = np.ones(72, bool)


def vacuum(outer_kpa, sigma_kpa=0.35):
    return ChamberVacuum(42.0 - outer_kpa, 42.0, sigma_kpa, sigma_kpa)


def model(name, sought_kpa=SOUGHT_KPA, reference=True, **material):
    liner = solved(name)
    open_liner = as_points(liner.places_mm(0.0), np.full(3, 0.005)) if reference else None
    return PressureModel(liner.grid, liner.zones(**material), open_liner, sought_kpa)


@pytest.fixture(scope="module")
def closing():
    """Maps of the reference liner closing on a round teat, with what is true."""
    liner, pressure = solved("reference-round"), model("reference-round")
    differences = (12.0, 18.0, 26.0)
    maps = [
        pressure_map(pressure, liner.points(kpa, seed), SEEN, vacuum(kpa))
        for seed, kpa in enumerate(differences)
    ]
    return maps, [liner.contact_kpa(kpa) for kpa in differences]


def test_the_pressure_is_that_of_the_solved_wall_within_3_kpa(closing):
    maps, true = closing
    off = np.concatenate([one.contact_kpa.value - truth for one, truth in zip(maps, true, strict=True)])
    assert max(np.abs(truth).max() for truth in true) > 30
    assert np.sqrt(np.mean(off**2)) < 3.0


def test_sigma_says_how_far_it_is_off(closing):
    maps, true = closing
    ratio = [
        (one.contact_kpa.value - truth) / one.contact_kpa.sigma for one, truth in zip(maps, true, strict=True)
    ]
    assert 0.05 < np.mean(np.square(ratio)) < 1.4


def test_the_mean_of_the_seen_part_is_right_to_1_kpa_and_so_is_its_sigma(closing):
    maps, true = closing
    for one, truth in zip(maps, true, strict=True):
        assert one.mean_kpa.value == pytest.approx(truth.mean(), abs=1.5)
        assert 0.2 < one.mean_kpa.sigma < 1.5


def test_a_wall_that_fits_has_a_small_misfit(closing):
    assert all(0.3 < one.misfit < 1.3 for one in closing[0])


def test_the_pressure_above_atmosphere_is_less_by_the_liner_s_vacuum(closing):
    for one in closing[0]:
        assert one.above_atmosphere_kpa.value == pytest.approx(one.contact_kpa.value - 42.0)
        assert (one.above_atmosphere_kpa.sigma >= one.contact_kpa.sigma).all()


def test_where_sigma_exceeds_the_pressure_sought_the_map_says_so():
    liner = solved("reference-round")
    found = pressure_map(model("reference-round", sought_kpa=0.5), liner.points(12.0, 0), SEEN, vacuum(12.0))
    refused = np.array([bool(reason) for reason in found.reason])
    assert refused.any()
    assert all("exceeds the pressure sought" in reason for reason in found.reason if reason)
    assert np.array_equal(refused, found.contact_kpa.sigma > np.maximum(found.contact_kpa.value, 0.5))


def test_a_place_without_targets_near_it_has_no_pressure():
    liner = solved("reference-round")
    within = SEEN.copy()
    within[10] = False
    found = pressure_map(model("reference-round"), liner.points(12.0, 0), within, vacuum(12.0))
    assert found.reason[10] == "no targets near enough"
    assert not any(reason for index, reason in enumerate(found.reason) if index != 10)


def test_points_that_no_load_explains_are_refused():
    liner = solved("reference-round")
    places = liner.places_mm(12.0)
    uneven = (liner.grid.row + liner.grid.column) % 2 == 0
    places[uneven, 2] += 0.4
    found = pressure_map(model("reference-round"), as_points(places, EIGHT_BITS_MM), SEEN, vacuum(12.0))
    assert found.misfit > 2
    assert found.profile is None
    with pytest.raises(
        AnalysisError,
        match="none of 72 places has its pressure determined: the wall in equilibrium contradicts",
    ):
        found.determined()


@pytest.mark.parametrize("design", ["wide", "tapered"])
def test_an_empty_liner_that_has_closed_gives_no_pressure_on_a_teat(design):
    liner = solved(f"{design}-empty")
    found = pressure_map(model(liner.name), liner.points(20.0, 0), SEEN, vacuum(20.0))
    assert set(found.reason) == {
        "opposite walls meet wherever the liner presses: it presses itself, there is no teat in it"
    }
    assert np.isnan(found.mean_kpa.value)
    with pytest.raises(AnalysisError, match="there is no teat in the closed liner"):
        teat_heights(found.profile)


@pytest.mark.parametrize("outer_kpa", [20.0, 40.0])
def test_a_liner_that_folds_across_the_view_has_no_pressure_that_cameras_could_find(outer_kpa):
    """Its points agree with a wall in equilibrium that presses where no target is."""
    liner = solved("reference-round")
    reference = as_points(liner.across_mm(0.0), np.full(3, 0.005))
    turned = PressureModel(liner.grid, liner.zones(), reference, 1.0)
    found = pressure_map(
        turned, as_points(liner.across_mm(outer_kpa), EIGHT_BITS_MM), SEEN, vacuum(outer_kpa)
    )
    assert found.misfit < 1.2
    assert {reason[:35] for reason in found.reason} == {"the wall bulges towards the cameras"}


@pytest.mark.parametrize("teat", ["round", "blunt", "pointed"])
@pytest.mark.parametrize("outer_kpa", [14.0, 40.0])
def test_a_liner_on_a_teat_is_not_taken_for_an_empty_one(teat, outer_kpa):
    liner = solved(f"tapered-{teat}")
    found = pressure_map(model(liner.name), liner.points(outer_kpa, 0), SEEN, vacuum(outer_kpa))
    assert found.usable.all()


def test_an_empty_liner_that_has_not_closed_presses_next_to_nothing():
    """The load's prior is never quite 0."""
    liner = solved("tapered-empty")
    found = pressure_map(model(liner.name), liner.points(11.0, 0), SEEN, vacuum(11.0))
    assert found.usable.all()
    assert found.mean_kpa.value < 1.0


def test_a_vacuum_that_is_badly_known_makes_sigma_larger():
    liner, pressure = solved("reference-round"), model("reference-round")
    good, bad = (
        pressure_map(pressure, liner.points(24.0, 0), SEEN, vacuum(24.0, sigma)) for sigma in (0.1, 6.0)
    )
    assert bad.mean_kpa.sigma > 1.1 * good.mean_kpa.sigma


def test_a_second_of_the_clocks_counts_by_how_fast_the_vacuum_changes():
    """10 ms at 45 kPa in 150 ms are 3 kPa."""
    moving = ChamberVacuum(20.0, 42.0, 0.0, 0.0, pulsation_slope_kpa_per_s=-300.0, time_sigma_s=1e-2)
    assert moving.difference_sigma_kpa == pytest.approx(3.0)


def test_several_materials_are_refused():
    liner = solved("reference-round")
    (zone,) = liner.zones()
    with pytest.raises(AnalysisError, match="needs one material for the whole liner, not 2 zones"):
        PressureModel(liner.grid, [zone, Zone(200.0, 300.0, zone.material)], None, SOUGHT_KPA)


def test_ends_that_the_targets_are_not_between_are_refused():
    liner = solved("reference-round")
    with pytest.raises(AnalysisError, match="not between the ends that hold the liner, -20 and 65 mm"):
        PressureModel(liner.grid, liner.zones(first_end_mm=-20.0), None, SOUGHT_KPA)


def test_a_liner_whose_ends_are_unknown_is_refused():
    liner = solved("reference-round")
    with pytest.raises(AnalysisError, match="needs the ends of the liner"):
        PressureModel(liner.grid, liner.zones(first_end_mm=None), None, SOUGHT_KPA)


def test_columns_that_one_view_alone_sees_make_the_map_and_its_mean_better():
    """Beside four columns with points, two more whose places are known across one view's rays only."""
    liner, random = solved_six("reference-round"), np.random.default_rng(3)
    reference = outermost_alone(liner, liner.places_mm(0.0), np.full(3, 0.005), random)
    field = outermost_alone(liner, liner.places_mm(36.0), EIGHT_BITS_MM, random)
    off, sigma, mean_sigma = {}, {}, {}
    for name, of_rig in (("points", None), ("rays", rig())):
        pressure = PressureModel(liner.grid, liner.zones(), reference, SOUGHT_KPA, rig=of_rig)
        found = pressure_map(pressure, field, liner.inner, vacuum(36.0))
        off[name] = found.contact_kpa.value - liner.contact_kpa(36.0)
        sigma[name], mean_sigma[name] = found.contact_kpa.sigma, found.mean_kpa.sigma
        assert (found.supported == (liner.inner | (of_rig is not None))).all()
    assert np.sqrt(np.mean(off["rays"] ** 2)) < np.sqrt(np.mean(off["points"] ** 2)) < 3.5
    assert np.mean((off["rays"] / sigma["rays"]) ** 2) < 1.4
    # Of the mean over the seen part; that of the rays is over two columns more.
    assert mean_sigma["rays"] < 0.8 * mean_sigma["points"]
