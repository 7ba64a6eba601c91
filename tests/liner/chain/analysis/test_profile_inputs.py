"""Inputs from profiles: found by labels, overruled by what is given, and refused where they contradict."""

from typing import Any

import pytest
import yaml

from core.chain.milking import grid
from grabberd.config import shipped_configs
from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import InputError
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.chain.analysis.inputs import read_inputs
from grabberd_liner.chain.analysis.profile_inputs import (
    Profile,
    ResolvedInputs,
    Subject,
    resolve,
    with_recorded,
)
from liner.chain.analysis.profiling import ALL, COW, CUP, LAG, LINER, MATERIAL, PULSATOR, SETTINGS, changed

LABELS = {"liner": "A", "pulsator": "north", "cup": "1", "cow": "112", "teat": "front left"}


def profiles(*documents: dict[str, Any]) -> list[Profile]:
    return [Profile(one["kind"], one["name"], 3, "0" * 64, one) for one in documents]


def resolved(
    *documents: dict[str, Any],
    given: dict[str, Any] | None = None,
    labels: dict[str, str] | None = None,
    recorded: tuple[str, ...] = (),
) -> ResolvedInputs:
    subject = Subject("teatcup", "liner", grid(), {name: (name,) for name in recorded})
    return resolve(LABELS if labels is None else labels, profiles(*documents), given or {}, subject)


def test_the_labels_of_a_capture_find_everything_that_an_analysis_takes() -> None:
    found = resolved(*ALL)
    assert found.inputs == {
        "material": MATERIAL,
        "reference": "nominal",
        "phases": 4,
        "sought_kpa": 20.0,
        "vacuum": {
            "liner": PULSATOR["liner"],
            "lag": {**LAG, "near_s": 0.0},
            "pulsation": SETTINGS,
            "gauge_sigma_kpa": 0.2,
        },
        "flow_stop": COW["flow_stop"],
    }
    assert found.lacks == []
    assert [one.kind for one in found.used] == ["liner", "pulsator", "cup", "cow"]


def test_they_are_inputs_as_the_analysis_reads_them() -> None:
    read = read_inputs(resolved(*ALL).inputs, grid())
    assert read.zones[0].material.E_sigma_mpa == 0.1
    assert read.lacks == (
        "material.first_end_mm, material.last_end_mm: without them no pressure",
        "plane: without it no widths and volume of a liner that is seen from one side",
    )


def test_each_says_which_version_of_which_profile_it_comes_from() -> None:
    sources = resolved(*ALL).sources
    assert sources["material"] == sources["vacuum.lag"] == "liner profile A, version 3"
    assert sources["vacuum.pulsation"] == sources["vacuum.liner"] == "pulsator profile north, version 3"
    assert sources["flow_stop"] == "cow profile 112, version 3"


def test_a_cup_says_what_its_sensor_reads_while_milk_flows_where_that_was_recorded() -> None:
    cup = {**CUP, "milk_flow": "low"}
    assert "milk_flow" not in resolved(LINER, cup).inputs
    found = resolved(LINER, cup, recorded=("pulsation", "liner", "flow"))
    assert found.inputs["milk_flow"] == "low"
    assert found.sources["milk_flow"].startswith("cup profile")


def test_what_is_given_wins() -> None:
    other = {**MATERIAL, "E_mpa": 2.0}
    given = {"material": other, "phases": 8, "vacuum": {"liner": {"kpa": 40, "sigma_kpa": 1}}}
    found = resolved(*ALL, given=given)
    assert (found.inputs["material"], found.inputs["phases"]) == (other, 8)
    assert found.inputs["vacuum"]["liner"] == {"kpa": 40, "sigma_kpa": 1}
    assert found.inputs["vacuum"]["pulsation"] == SETTINGS
    assert not {"material", "phases", "vacuum.liner"} & found.sources.keys()


def test_the_inputs_given_are_left_as_they_are() -> None:
    given = {"vacuum": {"liner": {"kpa": 40, "sigma_kpa": 1}}}
    resolved(*ALL, given=given)
    assert given == {"vacuum": {"liner": {"kpa": 40, "sigma_kpa": 1}}}


def test_a_profile_that_gives_nothing_is_not_said_to_be_used() -> None:
    given = {"material": MATERIAL, "reference": "nominal", "phases": 4, "sought_kpa": 1.0}
    assert resolved(changed(LINER, "lag", None), given=given).used == []


def test_a_log_takes_the_place_of_a_pulsators_settings() -> None:
    log = {
        "pulsation": "log",
        "log": "time_s,pulsation_vacuum_kpa\n0,0",
        "offset": {"s": 0, "sigma_s": 0.001},
    }
    vacuum = resolved(*ALL, given={"vacuum": log}).inputs["vacuum"]
    assert {key: vacuum[key] for key in log} == log
    assert vacuum["liner"] == PULSATOR["liner"]
    assert "lag" not in vacuum


def test_a_log_that_is_not_referred_to_keeps_the_settings_out_as_well() -> None:
    assert "pulsation" not in resolved(*ALL, given={"vacuum": {"log": "time_s\n0"}}).inputs["vacuum"]


def test_a_ramp_with_the_empty_liner_is_no_pulsation() -> None:
    assert "pulsation" not in resolved(*ALL, given={"teat": "none"}).inputs["vacuum"]


def test_settings_that_nothing_dates_are_left_out_and_it_is_said() -> None:
    found = resolved(changed(LINER, "lag", None), PULSATOR, CUP, COW)
    assert "pulsation" not in found.inputs["vacuum"]
    assert any("nothing says when" in words for words in found.lacks)


@pytest.mark.parametrize(("start", "lag"), [({}, True), ({"start_s": 0.1, "start_sigma_s": 0.001}, False)])
def test_settings_that_are_given_are_dated_by_the_liner_unless_they_say_when_they_begin(
    start: dict[str, float], lag: bool
) -> None:
    found = resolved(LINER, given={"vacuum": {"pulsation": {**SETTINGS, **start}}})
    assert ("lag" in found.inputs["vacuum"]) == lag


def test_a_label_that_names_no_profile_is_said() -> None:
    found = resolved(LINER, PULSATOR, CUP, labels={**LABELS, "cow": "113"})
    assert "flow_stop" not in found.inputs
    assert found.lacks == ["cow profile: none in use is called '113', as the label cow says"]


def test_a_capture_without_such_labels_gets_what_is_given_and_it_is_said() -> None:
    found = resolved(*ALL, given={"phases": 3}, labels={"teat": "front left"})
    assert (found.inputs, found.used) == ({"phases": 3}, [])
    assert found.lacks == [
        "profiles: the capture has none of the labels liner, pulsator, cup, cow, so none was found"
    ]


def test_a_liner_without_a_material_says_so() -> None:
    found = resolved({"kind": "liner", "name": "A"}, labels={"liner": "A"})
    assert found.lacks == ["material: the liner profile A, version 3 has none yet"]


def test_all_contradictions_are_said_at_once() -> None:
    wide = changed(LINER, "material.radius_mm", 15.0)
    other = {**CUP, "device": "south", "object_model": "teat"}
    with pytest.raises(InputError) as refused:
        resolved(wide, PULSATOR, other, COW)
    said = refused.value.message
    assert "liner profile A, version 3: its targets lie 32.5 mm apart across the liner" in said
    assert "it is of the device south, the capture was recorded by teatcup" in said
    assert "its object model is teat, the capture was measured with liner" in said
    assert "profile" in refused.value.hint


@pytest.mark.parametrize(("share", "allowed"), [(1.01, True), (1.02, False), (0.98, False)])
def test_a_liner_half_a_millimetre_off_the_object_model_is_another_one(share: float, allowed: bool) -> None:
    """Its walls would touch 6 kPa from where they do."""
    like = changed(LINER, "material.radius_mm", float(LINER["material"]["radius_mm"]) * share)
    if allowed:
        assert resolved(like).inputs["material"]["radius_mm"] == like["material"]["radius_mm"]
        return
    with pytest.raises(InputError, match="apart across the liner"):
        resolved(like)


def test_a_liner_that_is_overruled_contradicts_nothing() -> None:
    wide = changed(LINER, "material.radius_mm", 15.0)
    assert resolved(wide, given={"material": MATERIAL}).inputs["material"] == MATERIAL


def test_zones_beyond_the_object_model_are_a_contradiction() -> None:
    zones = [{**MATERIAL, "rows": [0, 3]}, {**MATERIAL, "rows": [4, 9]}]
    with pytest.raises(InputError, match="a zone ends with row 9, the object model with row 6"):
        resolved({**LINER, "material": {"zones": zones}})


def test_inputs_of_the_wrong_form_are_left_to_their_own_reader() -> None:
    found = resolved(*ALL, given={"vacuum": "none"})
    assert found.inputs["vacuum"] == "none"
    with pytest.raises(InputError, match="vacuum: is 'none'"):
        read_inputs(found.inputs, grid())


def test_the_examples_that_are_shipped_give_the_inputs_that_are_shipped_for_the_same_liner() -> None:
    configs = shipped_configs()
    model = ObjectModel.from_document(yaml.safe_load((configs / "objects" / "liner.yaml").read_text("utf-8")))
    shipped = yaml.safe_load((configs / "analysis" / "liner.yaml").read_text("utf-8"))
    for key in ("start_s", "start_sigma_s"):  # `lag` finds it
        del shipped["vacuum"]["pulsation"][key]
    names = ("liner-example-reference", "pulsator-example-simulated")
    examples = [yaml.safe_load((configs / "profiles" / f"{one}.yaml").read_text("utf-8")) for one in names]
    labels = {"liner": "example-reference", "pulsator": "example-simulated"}
    found = resolve(labels, profiles(*examples), {}, Subject("simulated", "liner", Grid.of(model)))
    assert found.inputs == shipped


def test_what_was_recorded_with_the_capture_goes_before_what_is_usual() -> None:
    found = resolved(*ALL, recorded=("pulsation", "liner", "mouthpiece"))
    assert found.inputs["vacuum"] == {"pulsation": "channel", "liner": "channel"}
    assert "pulsator" not in [one.kind for one in found.used]


def test_of_two_channels_that_could_be_a_vacuum_none_is_taken_nor_what_is_usual() -> None:
    subject = Subject("teatcup", "liner", grid(), {"pulsation": ("front", "rear"), "liner": ("liner",)})
    for found in (resolve(LABELS, profiles(*ALL), {}, subject), with_recorded({}, subject)):
        assert found.inputs["vacuum"]["liner"] == "channel"
        assert "pulsation" not in found.inputs["vacuum"]
        (said,) = found.lacks
        assert "the channels front and rear of this capture could each be it" in said
        assert "vacuum: {pulsation: {channel: front}}" in said


def test_channels_are_taken_without_profiles_but_not_beside_a_log_or_a_lag() -> None:
    subject = Subject("teatcup", "liner", grid(), {"pulsation": ("pulsation",)})
    found = with_recorded({}, subject)
    assert (found.inputs, found.taken) == ({"vacuum": {"pulsation": "channel"}}, {"pulsation"})
    for other in ("log", "lag"):
        given = {"vacuum": {other: {}}}
        assert with_recorded(given, subject).inputs == given


def test_a_chamber_that_was_not_recorded_comes_from_the_pulsator() -> None:
    found = resolved(*ALL, recorded=("pulsation",))
    assert found.inputs["vacuum"] == {"pulsation": "channel", "liner": PULSATOR["liner"]}


def test_what_is_given_goes_before_what_was_recorded() -> None:
    given = {"vacuum": {"pulsation": {"kpa": 42.0, "sigma_kpa": 0.5}}}
    found = resolved(given=given, recorded=("pulsation", "liner"))
    assert found.inputs["vacuum"] == {**given["vacuum"], "liner": "channel"}
    logged = {"vacuum": {"pulsation": "log", "liner": "log", "log": "…", "offset": "light"}}
    assert resolved(given=logged, recorded=("pulsation", "liner")).inputs == logged
