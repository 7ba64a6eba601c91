"""Overpressure as quantities, and by the map: of made-up loads, and of walls solved as solids."""

from functools import cache

import numpy as np
import pytest

from grabberd.errors import AnalysisError
from grabberd_fake.liner_options import LinerOptions
from grabberd_fake.liner_truth import quantities_of
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.load.liner_compression import COMPRESSION_SHARE
from grabberd_liner.analysis.load.load_profile import mean_profile, teat_heights
from grabberd_liner.analysis.load.overpressure import (
    AGREED_KPA,
    QUANTITIES,
    LoadedState,
    map_flow_stop,
    overpressure_quantities,
)
from grabberd_liner.analysis.vacuum.milk_flow import FlowStop
from liner.analysis.load.profiles import closed, pressure_model, vacuum
from liner.analysis.walls import pressure_map, solved

CLOSED_KPA, OPENS_KPA = 42.0, 12.0
"""The made-up liner presses in proportion to the difference beyond the second."""


def at_end_kpa():
    """Contact pressure on the last of the teat of the made-up liner at its full load."""
    heights = teat_heights(mean_profile([closed()], np.ones(1), np.ones((1, 1))))
    span = closed().spans_within(*heights.last_of_teat_mm)
    return float(closed().compression_kpa.value @ span / span.sum())


def contact_kpa(difference_kpa):
    return at_end_kpa() * (difference_kpa - OPENS_KPA) / (CLOSED_KPA - OPENS_KPA)


def states(differences_kpa, scale=1.0):
    """States of the made-up liner, with loads that are wrong by a factor."""
    loads = [max(one - OPENS_KPA, 0.0) / (CLOSED_KPA - OPENS_KPA) * scale for one in differences_kpa]
    return [LoadedState(closed(load), vacuum(kpa)) for load, kpa in zip(loads, differences_kpa, strict=True)]


SPREAD = np.r_[np.arange(2.0, 42.0, 2.5), [42.0] * 6]


def occlusion(kpa, sigma_kpa=0.1):
    return Estimate.of(kpa, sigma_kpa)


def test_the_map_gives_the_difference_at_which_the_teat_s_end_is_pressed_by_so_much():
    found = map_flow_stop(states(SPREAD), occlusion(contact_kpa(33.0)))
    assert found.difference_kpa.value == pytest.approx(33.0, abs=1e-6)
    assert found.overpressure_kpa.value == pytest.approx(CLOSED_KPA - 33.0, abs=1e-6)


def test_the_order_of_the_states_does_not_matter():
    shuffled = np.random.default_rng(0).permutation(SPREAD)
    found = map_flow_stop(states(shuffled), occlusion(contact_kpa(33.0)))
    assert found.difference_kpa.value == pytest.approx(33.0, abs=1e-6)


def test_sigma_is_that_of_the_model_and_of_the_occlusion_pressure():
    rng, true_kpa, sigma_kpa = np.random.default_rng(2), contact_kpa(33.0), 2.0
    off = []
    for _ in range(200):
        scale = 1 + COMPRESSION_SHARE * rng.normal()
        given = occlusion(true_kpa + sigma_kpa * rng.normal(), sigma_kpa)
        found = map_flow_stop(states(SPREAD, scale), given).overpressure_kpa
        off.append((float(found.value) - 9.0) / float(found.sigma))
    assert 0.7 < np.mean(np.square(off)) < 1.4


def test_noise_of_single_states_does_not_move_the_passage_far():
    rng = np.random.default_rng(3)
    noisy = [
        one._replace(profile=one.profile.moved(*np.outer([3.0, 0.0, 0.0], np.ones(23)) * rng.normal()))
        for one in states(np.r_[np.arange(12.0, 42.0, 0.5), [42.0] * 12])
    ]
    found = map_flow_stop(noisy, occlusion(contact_kpa(33.0)))
    assert found.difference_kpa.value == pytest.approx(33.0, abs=1.5)


def test_states_far_apart_give_no_difference():
    sparse = [2.0, 8.0, 20.0, 42.0, 42.0]
    with pytest.raises(
        AnalysisError, match=r"between states at 20.0 and 42.0 kPa .* too far apart"
    ) as caught:
        map_flow_stop(states(sparse), occlusion(contact_kpa(33.0)))
    assert "more phases" in caught.value.hint


def test_an_occlusion_pressure_that_is_never_reached_gives_none():
    with pytest.raises(AnalysisError, match="never passes the 90 kPa of flow_stop"):
        map_flow_stop(states(SPREAD), occlusion(90.0))


def test_without_a_teat_s_end_there_is_none():
    blind = [LoadedState(closed(below=False), vacuum(42.0)) for _ in range(4)]
    with pytest.raises(AnalysisError, match="the teat's end is not among the heights that are seen"):
        map_flow_stop(blind, occlusion(20.0))


def test_without_a_state_there_is_none():
    with pytest.raises(AnalysisError, match="no state of the wall has a load"):
        map_flow_stop([], occlusion(20.0))


@cache
def solved_states(wall):
    """A liner closing on its teat, found from noisy points at differences 2 kPa apart."""
    liner = solved(wall)
    model, seen = pressure_model(liner), np.ones(len(liner.grid), bool)
    differences = np.arange(14.0, 27.0, 2.0)
    return [
        LoadedState(pressure_map(model, liner.points(kpa, seed), seen, vacuum(kpa)).profile, vacuum(kpa))
        for seed, kpa in enumerate(differences)
    ]


@pytest.mark.parametrize("wall", ["reference-round", "reference-blunt"])
def test_a_wall_solved_as_a_solid_has_its_flow_stop_found(wall):
    found = map_flow_stop(solved_states(wall), occlusion(16.0, 1.0)).difference_kpa
    true_kpa = quantities_of(LinerOptions(wall), 16.0)["flow_stop_map_kpa"]
    assert abs(float(found.value) - true_kpa) < 2.5 * float(found.sigma)
    assert float(found.sigma) < 2.0


DERIVED = FlowStop(Estimate.of(33.5, 0.1), Estimate.of(8.5, 0.15), Estimate.of(0.66, 0.001), 20, 0.05)
MAP = FlowStop(Estimate.of(32.0, 1.0), Estimate.of(10.0, 1.0), None, 24, 0.8)
LACKS = "milk_flow was not given"


def by_name(derived=LACKS, raised=LACKS, by_map=LACKS, gauge_sigma_kpa=0.3):
    found = overpressure_quantities(derived, raised, by_map, gauge_sigma_kpa)
    assert [one.quantity.name for one in found] == list(QUANTITIES)
    return {one.quantity.name: one for one in found}


def test_a_way_that_lacks_something_says_what():
    assert {one.reason for name, one in by_name().items() if "disagreement" not in name} == {LACKS}
    assert "only one way" in by_name(derived=DERIVED)["overpressure_disagreement_kpa"].reason


def test_overpressure_is_free_of_the_gauges_zero_and_the_difference_at_flow_stop_is_not():
    found = by_name(derived=DERIVED)
    over, stop = found["overpressure_derived_kpa"], found["flow_stop_derived_kpa"]
    assert (over.value, over.sigma, over.common) == (8.5, 0.15, 0.05)
    assert (stop.value, stop.sigma) == (33.5, pytest.approx(np.hypot(0.1, 0.3)))
    assert found["flow_duration_s"].value == 0.66


@pytest.mark.parametrize("way", ["derived", "raised"])
def test_where_two_ways_lead_to_it_they_are_compared(way):
    found = by_name(**{way: DERIVED, "by_map": MAP})["overpressure_disagreement_kpa"]
    assert found.value == pytest.approx(-1.5)
    assert found.sigma == pytest.approx(np.hypot(0.15, 1.0))
    assert f"{AGREED_KPA:.1f} kPa" in found.quantity.definition
