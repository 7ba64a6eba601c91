"""The pressure in an analysis: on a wall that was solved as a solid, and what is said where there is none."""

import numpy as np
import pytest

from core.chain.solved_milking import DIFFERENCES_KPA, LINER, LINER_KPA, analysed, material, whole
from grabberd_liner.chain.analysis.tables import tables
from liner.analysis.walls import solved

CLOSING = (24.0, 24.3)


def without_ends():
    return {key: value for key, value in material().items() if not key.endswith("_end_mm")}


def reasons(found):
    return [words for words in found.problems if words.startswith("field")]


def test_pressure_is_the_walls_within_its_sigma() -> None:
    maps = [state.pressure for state in whole().states]
    assert None not in maps
    for one, kpa in list(zip(maps, DIFFERENCES_KPA, strict=True))[1:]:
        off = one.contact_kpa.value - solved(LINER).contact_kpa(kpa)
        assert np.sqrt(np.mean((off / one.contact_kpa.sigma) ** 2)) < 1.5
        assert abs(off.mean()) < 2.5 * one.mean_kpa.sigma < 4
        assert one.mean_kpa.value > 5


def test_the_vacuum_in_the_liner_takes_it_below_atmosphere() -> None:
    for state in whole().states:
        above = state.pressure.contact_kpa.value - LINER_KPA
        assert np.allclose(state.pressure.above_atmosphere_kpa.value, above, atol=0.1)


def test_a_pressure_that_its_sigma_exceeds_is_refused_with_the_reason() -> None:
    refused = 0
    for state in whole().states:
        contact, reason = state.pressure.contact_kpa, np.array(state.pressure.reason)
        exceeds = state.within & (contact.sigma > np.maximum(contact.value, 1.0))
        assert all("exceeds the pressure sought" in words for words in reason[exceeds])
        refused += exceeds.sum()
    assert refused


def test_where_no_place_has_a_pressure_the_field_says_why() -> None:
    vague = {chamber: {"kpa": 42, "sigma_kpa": 20} for chamber in ("pulsation", "liner")}
    found = analysed((0.0, 0.0), vacuum=vague, sought_kpa=0.01)
    assert not any(state.pressure.usable.any() for state in found.states)
    assert all(state.pressure.misfit > 0 for state in found.states)
    assert any("none of 72 places has its pressure determined" in words for words in reasons(found))


@pytest.mark.parametrize(
    ("inputs", "lacks"),
    [
        ({"material": without_ends()}, "material.first_end_mm"),
        ({"reference": None}, "reference"),
        ({"vacuum": None}, "vacuum.pulsation"),
    ],
)
def test_without_one_of_its_inputs_there_is_no_pressure_and_it_is_said(inputs, lacks) -> None:
    found = analysed(CLOSING, **inputs)
    assert [state.pressure for state in found.states] == [None] * 2
    assert any(words.startswith(lacks) for words in found.inputs.lacks)


def test_a_field_in_which_the_wall_moves_too_fast_has_no_pressure_and_says_so() -> None:
    steady, snap = [24.0] * 5, [0.0] * 5
    found = analysed((*snap, *steady), reference={"field": 0})
    has = [bool(state.pressure.usable.any()) for state in found.states]
    assert has == [True] * 4 + [False] * 2 + [True] * 4
    said = found.states[4].pressure.reason
    assert set(said) == {"the wall moves at more than 300 mm/s: too fast for an equilibrium"}
    assert found.states[4].pressure.profile is None
    assert "field 4, field 5: the wall moves at more than 300 mm/s" in " ".join(reasons(found))


def test_the_shape_of_a_wall_that_moves_too_fast_is_still_the_wall_s() -> None:
    found = analysed((*[0.0] * 5, *[24.0] * 5), reference={"field": 0})
    assert {state.method for state in found.states} == {"equilibrium"}
    assert all(np.isfinite(state.strain.value).all() for state in found.states)


def test_the_mirror_image_of_the_seen_half_is_compared_with_a_free_one() -> None:
    found = analysed((0.0, 12.0), unseen="mirrored")
    free = analysed((0.0, 12.0))
    for mirrored, one in zip(found.states, free.states, strict=True):
        apart = mirrored.pressure.contact_kpa.value - one.pressure.contact_kpa.value
        assert np.allclose(mirrored.pressure.unseen_kpa, apart, atol=0.05)
        assert one.pressure.unseen_kpa is None
    told = tables(found)["targets"].column("unseen_kpa")
    known = np.isfinite(tables(found)["targets"].column("contact_kpa"))
    assert np.array_equal(np.isfinite(told), known)
    assert known.any()
    assert np.isnan(tables(free)["targets"].column("unseen_kpa")).all()
