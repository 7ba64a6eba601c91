"""Captures by the folders of their analyses: what is found, and what is said of the rest."""

from pathlib import Path
from typing import Any

import pytest

from grabberd.errors import InputError
from grabberd_liner.studies.captures import captures_of_folders
from liner.studies.results import COMPRESSION, OVERPRESSURE, quantity, report, store, table


def test_folders_are_found_at_any_depth_hidden_ones_are_not(tmp_path: Path) -> None:
    store(tmp_path / "a", report("a"))
    store(tmp_path / "deep" / "er" / "b", report("b"))
    store(tmp_path / ".part-1", report("c"))
    captures, left_out = captures_of_folders([tmp_path])
    assert sorted(one.id for one in captures) == ["a", "b"]
    assert left_out == []


def test_a_capture_has_what_its_report_says(tmp_path: Path) -> None:
    store(tmp_path / "a", report("a"))
    one = captures_of_folders([tmp_path / "a"])[0][0]
    assert (one.captured_utc[:10], one.device, one.verdict, one.labels["cow"]) == (
        "2026-11-05",
        "barn",
        "complete",
        "112",
    )
    assert one.found[COMPRESSION][:4] == ("kPa", 40.0, 0.5, 0.3)
    assert one.found[OVERPRESSURE].reason == "flow_stop was not given"
    assert one.meanings[COMPRESSION] == (f"title of {COMPRESSION}", "what it is")
    assert one.analysis == str(tmp_path / "a")


def test_a_capture_with_lost_fields_is_incomplete(tmp_path: Path) -> None:
    document = report("a")
    document["about"]["ledger"]["lacking"] = [{"outcome": "lost"}]
    store(tmp_path / "a", document)
    assert captures_of_folders([tmp_path])[0][0].verdict == "incomplete"


def test_of_two_analyses_of_a_capture_the_newer_counts_and_it_is_said(tmp_path: Path) -> None:
    store(tmp_path / "1", report("a", 40.0))
    store(tmp_path / "2", report("a", 41.0, created_utc="2026-11-21T08:00:00.000Z"))
    store(tmp_path / "3", report("a", 39.0, created_utc="2026-11-19T08:00:00.000Z"))
    captures, left_out = captures_of_folders([tmp_path])
    assert [one.found[COMPRESSION].value for one in captures] == [41.0]
    assert len(left_out) == 2
    assert all("a newer analysis of it is in" in one.reason for one in left_out)


def test_a_copy_counts_once_and_a_folder_named_twice_is_one(tmp_path: Path) -> None:
    store(tmp_path / "1", report("a"))
    assert captures_of_folders([tmp_path, tmp_path / "1"])[1] == []
    store(tmp_path / "2", report("a"))
    captures, left_out = captures_of_folders([tmp_path])
    assert len(captures) == 1
    assert "it counts once" in left_out[0].reason


def test_a_folder_without_any_is_refused_with_the_command_that_makes_some(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no analysis is in") as refused:
        captures_of_folders([tmp_path])
    assert "grabberd analyse" in refused.value.hint


def test_an_analysis_with_outdated_pressures_is_left_out(tmp_path: Path) -> None:
    old = report("a", pressure_method=None)
    old["tables"]["fields"] = table([{"mean_contact_kpa": 8.0}], ("mean_contact_kpa",))
    store(tmp_path / "a", old)
    captures, left_out = captures_of_folders([tmp_path])
    assert captures == []
    assert "earlier, wrong way" in left_out[0].reason


def test_an_earlier_overpressure_counts_as_what_it_is(tmp_path: Path) -> None:
    old = report("a")
    names = next(one for one in old["tables"]["quantities"]["columns"] if one["name"] == "name")
    names["values"][names["values"].index(OVERPRESSURE)] = "overpressure_kpa"
    store(tmp_path / "a", old)
    ((one,), _) = captures_of_folders([tmp_path])
    now = "teat_end_beyond_flow_stop_kpa"
    assert now in one.found
    assert "overpressure_kpa" not in one.found
    assert one.meanings[now].title == "contact pressure at the teat's end beyond flow stop"


def test_an_analysis_of_a_version_without_quantities_is_left_out(tmp_path: Path) -> None:
    old = report("a")
    del old["tables"]["quantities"]
    store(tmp_path / "a", old)
    assert "had no quantities: analyse it again" in captures_of_folders([tmp_path])[1][0].reason


def test_the_common_part_is_unknown_where_the_table_has_none(tmp_path: Path) -> None:
    old = report("a")
    columns = tuple(
        one["name"] for one in old["tables"]["quantities"]["columns"] if one["name"] != "sigma_common"
    )
    old["tables"]["quantities"] = table([quantity(COMPRESSION, 40.0)], columns)
    store(tmp_path / "a", old)
    assert captures_of_folders([tmp_path])[0][0].found[COMPRESSION].common is None


@pytest.mark.parametrize(
    "content",
    [
        "{",
        "[]",
        '{"schema": "grabberd/calibration-report/1"}',
        '{"schema": "grabberd/analysis-report/1"}',
        '{"schema": "grabberd/analysis-report/1", "id": "a", "about": 3}',
        "[" * 100_000,
    ],
)
def test_what_is_no_report_is_left_out_with_the_reason(tmp_path: Path, content: str) -> None:
    store(tmp_path / "a", report("a"))
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "report.json").write_text(content)
    captures, left_out = captures_of_folders([tmp_path])
    assert [one.id for one in captures] == ["a"]
    assert [one.capture for one in left_out] == [str(tmp_path / "b")]
    assert left_out[0].reason.startswith("its report.json ")


def test_words_in_place_of_numbers_are_damage(tmp_path: Path) -> None:
    document = report("a")
    next(one for one in document["tables"]["quantities"]["columns"] if one["name"] == "value")["values"][
        0
    ] = "x"
    store(tmp_path / "a", document)
    assert "is damaged" in captures_of_folders([tmp_path])[1][0].reason


MATERIAL = {"E_mpa": 3.0, "wall_mm": 2.5}


@pytest.mark.parametrize(
    ("changes", "liner"),
    [
        (
            {
                "profiles": [
                    {"kind": "cow", "name": "112", "version": 1},
                    {"kind": "liner", "name": "A", "version": 3},
                ]
            },
            "A, version 3",
        ),
        ({}, "A"),
        ({"labels": {}}, "material "),
        ({"labels": {}, "material": None}, ""),
    ],
)
def test_the_liner_is_that_of_its_profile_else_its_label_else_its_material(
    tmp_path: Path, changes: dict[str, Any], liner: str
) -> None:
    document = report("a")
    document["inputs"]["given"] = {"material": changes.pop("material", MATERIAL)}
    document["about"] |= changes
    store(tmp_path / "a", document)
    found = captures_of_folders([tmp_path])[0][0].liner
    assert found.startswith(liner)
    assert bool(found) is bool(liner)
