"""Captures of an archive with their newest analyses, read beside a daemon."""

import json
from pathlib import Path
from typing import Any

import pytest

from archive.captures import slots, write
from grabberd.archive.state.capture_index import CaptureIndex
from grabberd.archive.state.state_database import Annotation, AnnotationStore
from grabberd.errors import InputError, StorageError
from grabberd_liner.studies.captures import LocalArchive, Selection, captures_of_archive
from liner.studies.results import report, store

QUANTITIES = [
    {"name": "overpressure_map_kpa", "unit": "kPa", "value": 9.5, "sigma": 1.0, "sigma_common": 0.8}
]


class Barn:
    """A state directory with three captures, of liners A, A and B."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.captures = folder / "captures"
        self.captures.mkdir()
        for name, liner in (("a1", "A"), ("a2", "A"), ("b1", "B")):
            device = {"name": "cup"}
            write(self.captures, slots(2), name=name, id=name, device=device, labels={"liner": liner})
        CaptureIndex(self.captures).rebuild()

    def analyse(self, capture: str, number: int = 1, **record: Any) -> Path:
        home = self.folder / "analyses" / capture / str(number)
        home.mkdir(parents=True)
        whole = {
            "created_utc": "2026-11-20T08:00:00.000Z",
            "pressure_method": "equilibrium",
            "device": "cup",
            "quantities": QUANTITIES,
            **record,
        }
        (home / "record.json").write_text(json.dumps(whole))
        return home

    def found(self, *words: str) -> tuple[list[str], dict[str, str]]:
        taken, left_out = captures_of_archive(LocalArchive(self.folder), Selection.of(words))
        return sorted(one.id for one in taken), {one.capture: one.reason for one in left_out}


@pytest.fixture
def barn(tmp_path: Path) -> Barn:
    return Barn(tmp_path)


def test_captures_that_meet_the_conditions_come_with_their_analyses(barn: Barn) -> None:
    for name in ("a1", "a2", "b1"):
        barn.analyse(name)
    assert barn.found("liner=A") == (["a1", "a2"], {})
    taken, _ = captures_of_archive(LocalArchive(barn.folder), Selection.of(["id=a1"]))
    assert taken[0].found["overpressure_map_kpa"][:4] == ("kPa", 9.5, 1.0, 0.8)
    assert (taken[0].device, taken[0].verdict, taken[0].analysis, taken[0].liner) == (
        "cup",
        "complete",
        "1",
        "A",
    )


def test_titles_come_from_the_report_of_one_of_them(barn: Barn) -> None:
    barn.analyse("a1")
    store(barn.analyse("a2") / "report", report("a2"))
    (barn.folder / "analyses/a2/1/report/report.json").rename(barn.folder / "analyses/a2/1/report.json")
    taken, _ = captures_of_archive(LocalArchive(barn.folder), Selection.of(["liner=A"]))
    assert {one.meanings["overpressure_map_kpa"].title for one in taken} == {"title of overpressure_map_kpa"}


def test_captures_without_an_analysis_are_listed_and_others_not_asked_for_are_not(barn: Barn) -> None:
    barn.analyse("a1")
    assert barn.found("liner=A") == (["a1"], {"a2": "it has not been analysed"})


def test_the_newest_analysis_counts_and_is_not_replaced_by_an_older_one(barn: Barn) -> None:
    barn.analyse("a1", quantities=[{**QUANTITIES[0], "value": 8.0}])
    barn.analyse("a1", 2)
    taken, _ = captures_of_archive(LocalArchive(barn.folder), Selection.of(["id=a1"]))
    assert taken[0].found["overpressure_map_kpa"].value == 9.5
    (barn.analyse("a1", 3) / "record.json").write_text("{")
    assert "analysis 3 is damaged" in barn.found("id=a1")[1]["a1"]


def test_what_cannot_be_used_is_listed_with_the_reason(barn: Barn) -> None:
    full = {"reference": "nominal", "material": {}, "vacuum": {}, "sought_kpa": 1}
    barn.analyse("a1", pressure_method=None, inputs=full)
    barn.analyse("a2", quantities=[])
    barn.analyse("b1", quantities=[{"name": 3}])
    _, reasons = barn.found()
    assert "earlier, wrong way" in reasons["a1"]
    assert "had no quantities" in reasons["a2"]
    assert "cannot be read" in reasons["b1"]


def test_labels_that_were_given_later_count(barn: Barn) -> None:
    barn.analyse("b1")
    store = AnnotationStore(barn.folder / "state.sqlite")
    store.open()
    store.put("b1", Annotation(labels={"liner": "A"}))
    assert barn.found("liner=A", "id=b1") == (["b1"], {})


def test_a_damaged_capture_is_listed_whatever_its_labels_were(barn: Barn) -> None:
    (barn.captures / "a2.grab").write_bytes(b"no capture")
    CaptureIndex(barn.captures).rebuild()
    barn.analyse("a1")
    taken, reasons = barn.found("liner=A")
    assert taken == ["a1"]
    assert reasons["a2"].startswith("it is damaged: ")


def test_a_capture_whose_file_is_gone_is_listed_and_nothing_is_changed(barn: Barn) -> None:
    (barn.captures / "a2.grab").unlink()
    before = (barn.captures / "index.sqlite").read_bytes()
    assert "a2" in barn.found("liner=A")[1]
    assert (barn.captures / "index.sqlite").read_bytes() == before


def test_the_verdict_is_read_from_the_file(barn: Barn) -> None:
    barn.analyse("a1")
    assert barn.found("verdict=complete", "id=a1") == (["a1"], {})
    with pytest.raises(InputError, match="no capture of the archive has verdict=incomplete id=a1"):
        barn.found("verdict=incomplete", "id=a1")


def test_conditions_that_nothing_meets_are_refused(barn: Barn) -> None:
    with pytest.raises(InputError, match="no capture of the archive has liner=Z") as refused:
        barn.found("liner=Z")
    assert refused.value.hint


def test_without_an_archive_it_says_what_to_do_and_makes_none(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match=r"the archive's index .* cannot be read") as refused:
        captures_of_archive(LocalArchive(tmp_path / "none"), Selection.of([]))
    assert "--url" in refused.value.hint
    assert not (tmp_path / "none").exists()
