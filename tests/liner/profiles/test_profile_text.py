"""Profiles as people write them: read whole or refused with everything that is wrong."""

from contextlib import suppress
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grabberd.config import shipped_configs
from grabberd.errors import InputError
from grabberd_liner.chain.analysis.profile_inputs import quantity_problems
from grabberd_liner.profiles.profiles import checked_profile, plain_name, read_profile, write_profile
from liner.chain.analysis.profiling import ALL, COW, CUP, LINER, changed


def checked(document: dict[str, Any]) -> dict[str, Any]:
    return checked_profile(document, quantity_problems)


def refusal(document: dict[str, Any]) -> str:
    with pytest.raises(InputError) as refused:
        checked(document)
    assert "docs/howto/profiles.md" in refused.value.hint
    return refused.value.message


@pytest.mark.parametrize("document", ALL, ids=lambda one: one["kind"])
def test_a_profile_is_kept_as_it_was_written(document: dict[str, Any]) -> None:
    assert checked(document) == document
    assert read_profile(write_profile(checked(document))) == document


def test_keys_that_say_nothing_are_left_out() -> None:
    assert checked({**COW, "note": "", "breed": None, "lactation": None}) == COW


def test_its_kind_and_name_come_first() -> None:
    assert write_profile(checked(dict(reversed(LINER.items())))).startswith("kind: liner\nname: A\n")


def test_a_word_of_yaml_1_1_is_not_taken_for_a_number() -> None:
    said = refusal(read_profile("kind: cow\nname: A\nlactation: 1_0\n"))
    assert "lactation: '1_0' (line 3, column 12: a text in YAML 1.2; for a number write 10)" in said


@pytest.mark.parametrize(
    "file", sorted((shipped_configs() / "profiles").glob("*.yaml")), ids=lambda file: file.stem
)
def test_the_examples_that_are_shipped_can_be_used_and_say_that_they_are_examples(file: Any) -> None:
    profile = checked(read_profile(file.read_text("utf-8")))
    assert file.stem == f"{profile['kind']}-{profile['name']}"
    assert profile["name"].startswith("example-")
    assert profile["note"].startswith("Example, no real")


@pytest.mark.parametrize(
    ("document", "said"),
    [
        ({}, "kind: is None, expected liner, pulsator, cup or cow"),
        ({"kind": "bull", "name": "1"}, "kind: is 'bull', expected liner"),
        ({"kind": "cow"}, "name: is missing"),
        ({"kind": "cow", "name": 112}, 'name: it is the number 112: write the name in quotes, such as "112"'),
        ({"kind": "cow", "name": ""}, "name: a name has at most 64 letters"),
        ({"kind": "cow", "name": "../../passwd"}, "name: a name has at most 64 letters"),
        ({"kind": "cow", "name": ".."}, "name: a name has at most 64 letters"),
        ({"kind": "cow", "name": "a/b"}, "name: a name has at most 64 letters"),
        ({"kind": "cow", "name": "x" * 65}, "name: a name has at most 64 letters"),
        ({"kind": "cow", "name": "a\n"}, "name: a name has at most 64 letters"),
        (changed(COW, "colour", "red"), "colour: unknown key"),
        (changed(COW, "flow_stop.sigma_kpa", None), "flow_stop.sigma_kpa: is missing"),
        (changed(COW, "flow_stop.sigma_kpa", 0), "flow_stop.sigma_kpa: input should be greater than 0"),
        (changed(COW, "flow_stop.kpa", float("inf")), "flow_stop.kpa: input should be"),
        (
            changed(COW, "teats.front left.diameter_mm", 200),
            "teats.front left.diameter_mm: input should be less",
        ),
        (changed(COW, "teats.front left.shape", "long"), "teats.front left.shape: input should be 'round'"),
        (changed(COW, "teats", {str(at): {} for at in range(9)}), "teats: dictionary should have at most 8"),
        (changed(CUP, "gauge_sigma_kpa", -1), "gauge_sigma_kpa: input should be greater than 0"),
        (changed(CUP, "device", 7), "device: input should be a valid string"),
        (changed(LINER, "age_milkings", -1), "age_milkings: input should be greater than or equal to 0"),
        (changed(LINER, "lag.opening_s", 3), "lag.opening_s: input should be less"),
        (changed(LINER, "lag.near_s", 0), "lag.near_s: unknown key"),
        (changed(LINER, "material", "rubber"), "material: input should be a valid dictionary"),
        (changed(LINER, "note", "x" * 2001), "note: string should have at most 2000"),
    ],
)
def test_whatever_is_wrong_is_named_by_its_key(document: dict[str, Any], said: str) -> None:
    assert said in refusal(document)


def test_keys_and_quantities_that_are_wrong_are_said_together() -> None:
    wrong = changed(changed(changed(LINER, "material.E_sigma_mpa", None), "colour", "red"), "lag.sigma_s", 0)
    said = refusal(wrong)
    for part in ("'A'", "material.E_sigma_mpa", "colour: unknown key", "lag.sigma_s"):
        assert part in said


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "has no keys"),
        ("- liner", "has no keys"),
        ("liner", "has no keys"),
        ("kind: [", "not valid YAML"),
        ("a: &a [*a]", "contains itself"),
        ("!!python/object:os.system {}", "not valid YAML"),
        ("x: " + "[" * 60 + "]" * 60, "nested"),
    ],
)
def test_a_text_that_is_no_profile_is_refused(text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_profile(text)


def test_a_date_is_a_text_and_no_number() -> None:
    wrong = read_profile("kind: liner\nname: A\nlot: 2026-03-01\nmaterial: {E_mpa: 2026-03-01}\n")
    said = refusal(wrong)
    assert "lot" not in said
    assert "E_mpa: is '2026-03-01', expected a finite number" in said


def test_letters_with_marks_are_the_same_however_a_tablet_sends_them() -> None:
    assert (
        checked({"kind": "cow", "name": "Bla\u030aros"})["name"]
        == plain_name("Bla\u030aros")
        == "Bl\u00e5ros"
    )


@given(st.text(max_size=200))
def test_any_text_is_a_profile_or_refused(text: str) -> None:
    with suppress(InputError):
        assert checked(read_profile(text))["name"]
