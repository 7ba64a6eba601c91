"""Quantities of profiles: read as the analysis reads its inputs, and each known with a σ."""

from typing import Any

import pytest

from grabberd_liner.chain.analysis.profile_inputs import quantity_problems
from liner.chain.analysis.profiling import ALL, LINER, MATERIAL, PULSATOR, changed


@pytest.mark.parametrize("document", ALL, ids=lambda one: one["kind"])
def test_complete_profiles_have_no_problem(document: dict[str, Any]) -> None:
    assert quantity_problems(document) == []


def test_a_profile_may_say_little_but_not_half_of_a_material() -> None:
    assert quantity_problems({"kind": "liner", "name": "A"}) == []
    [problem] = quantity_problems(changed(LINER, "material.wall_mm", None))
    assert "wall_mm: is missing" in problem


def test_a_radius_may_be_left_to_the_object_model_with_how_it_was_obtained() -> None:
    without = changed(changed(LINER, "material.radius_mm", None), "obtained.radius_mm", None)
    assert quantity_problems(without) == []
    [problem] = quantity_problems(changed(LINER, "obtained.radius_mm", None))
    assert problem.startswith("obtained.radius_mm: is missing")


@pytest.mark.parametrize(
    ("document", "key", "value", "said"),
    [
        (LINER, "material.E_sigma_mpa", None, "material.E_sigma_mpa: is missing, expected a σ above 0"),
        (LINER, "material.wall_sigma_mm", 0.0, "material.wall_sigma_mm: is 0.0, expected a σ above 0"),
        (LINER, "material.F0_sigma_n", -3.0, "material.F0_sigma_n: is -3.0, expected a σ above 0"),
        (LINER, "material.E_mpa", -1.0, "E_mpa is -1, expected above 0"),
        (LINER, "material.E_mpa", float("nan"), "E_mpa: is nan, expected a finite number"),
        (LINER, "material.E_mpa", "3", "E_mpa: is '3', expected a finite number"),
        (LINER, "material.wall_mm", 40.0, "thicker than a liner of this radius"),
        (LINER, "material.hardness", 50, "hardness: unknown key"),
        (LINER, "material.poisson", 0.3, "keeps the volume"),
        (LINER, "obtained.F0_n", None, "obtained.F0_n: is missing, expected how it was obtained"),
        (LINER, "obtained.colour", "seen", "obtained.colour: unknown key"),
        (LINER, "analysis.phases", 1, "analysis.phases: is 1"),
        (LINER, "analysis.vacuum", {}, "analysis.vacuum: unknown key"),
        (LINER, "analysis.reference", {"phase": 2}, "analysis.reference.phase: is 2"),
        (LINER, "analysis.heights_mm", "low", "analysis.heights_mm: is 'low'"),
        (PULSATOR, "pulsation.sigma_kpa", 0.0, "pulsation.sigma_kpa: is 0.0, expected a σ above 0"),
        (PULSATOR, "pulsation.ratio", 60.0, "ratio 60 is not between .1 and .9"),
        (PULSATOR, "pulsation.a_s", None, "a_s: is missing"),
        (PULSATOR, "pulsation.start_s", 0.2, "pulsation.start_s: belongs to a capture"),
        (PULSATOR, "liner.kpa", 420.0, "a vacuum of 420 kPa"),
        (PULSATOR, "liner.sigma_kpa", None, "liner.sigma_kpa: is missing, expected a σ above 0"),
    ],
)
def test_whatever_is_wrong_is_named_by_its_key(
    document: dict[str, Any], key: str, value: Any, said: str
) -> None:
    assert any(said in problem for problem in quantity_problems(changed(document, key, value)))


def test_all_problems_are_said_at_once() -> None:
    wrong = changed(changed(LINER, "material.E_sigma_mpa", None), "material.wall_mm", -2.0)
    wrong = changed(changed(wrong, "obtained.radius_mm", None), "analysis.unseen", "guessed")
    said = "; ".join(quantity_problems(wrong))
    for part in ("E_sigma_mpa", "wall_mm is -2", "obtained.radius_mm", "analysis.unseen"):
        assert part in said


def test_every_zone_needs_its_own_sigmas() -> None:
    zones = [{**MATERIAL, "rows": [0, 2]}, {**MATERIAL, "rows": [3, 6]}]
    del zones[1]["F0_sigma_n"]
    assert quantity_problems({**LINER, "material": {"zones": zones}}) == [
        "material.zones[1].F0_sigma_n: is missing, expected a σ above 0"
    ]


@pytest.mark.parametrize("material", [{"zones": "soft"}, {"zones": [3]}, {"zones": []}, {}])
def test_materials_of_the_wrong_form_are_refused(material: dict[str, Any]) -> None:
    assert quantity_problems({**LINER, "material": material})
