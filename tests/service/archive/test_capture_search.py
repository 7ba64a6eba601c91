"""Captures are searched by id, note and labels without opening the files of those that are not meant."""

from pathlib import Path

import pytest

from grabberd.documents.captures import CaptureDocument
from grabberd.service.archive.archive import Archive
from grabberd.service.archive.capture_list import CaptureQuery, Position, list_captures
from grabberd.storage.state.annotation_store import Annotation
from grabberd.storage.state.index_entries import IndexEntry
from storage.captures import slots, write

SAID = {
    "c2": Annotation(note="slipped at 3 s"),
    "c3": Annotation(labels={"teat": "Rear Right"}),
    "c4": Annotation(pinned=True),
}


@pytest.fixture
def archive(tmp_path: Path) -> Archive:
    for day in range(1, 6):
        changes = {"id": f"c{day}", "created_utc": f"2026-03-0{day}T09:00:00.000Z"}
        write(tmp_path, slots(2), name=f"c{day}", note=f"Day {day}", labels={"cow": f"10{day}"}, **changes)
    archive = Archive(tmp_path, list, list, lambda one: SAID.get(one, Annotation()), lambda: SAID)
    archive.index.rebuild()
    return archive


def found(archive: Archive, **query: object) -> list[str]:
    return [document.id for document in list_captures(archive, CaptureQuery(**query))[0]]  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("search", "ids"),
    [
        ("day", ["c5", "c4", "c3", "c1"]),
        ("DAY 5", ["c5"]),
        ("101", ["c1"]),
        ("cow", ["c5", "c4", "c2", "c1"]),
        ("slipped", ["c2"]),
        ("rear right", ["c3"]),
        ("teat", ["c3"]),
        ("c4", ["c4"]),
        ("nothing", []),
    ],
)
def test_a_text_is_found_where_it_was_recorded_and_where_it_was_said_since(
    archive: Archive, search: str, ids: list[str]
) -> None:
    assert found(archive, search=search) == ids


def test_pinned_ones_are_found_among_others(archive: Archive) -> None:
    assert found(archive, pinned=True) == ["c4"]
    assert found(archive, pinned=False, search="day") == ["c5", "c3", "c1"]


def test_only_the_files_of_those_that_are_meant_are_opened(archive: Archive) -> None:
    opened: list[str] = []
    describe = archive.listed

    def counted(entry: IndexEntry, annotation: Annotation) -> CaptureDocument:
        opened.append(entry.id)
        return describe(entry, annotation)

    archive.listed = counted  # type: ignore[method-assign]
    assert found(archive, search="slipped") == ["c2"]
    assert opened == ["c2"]


def test_those_of_a_day_are_found_whatever_came_later(archive: Archive) -> None:
    day = {"since_utc": "2026-03-02T00:00:00.000Z", "until_utc": "2026-03-04T00:00:00.000Z"}
    assert found(archive, **day) == ["c3", "c2"]
    query = CaptureQuery(limit=1, **day)
    first, last = list_captures(archive, query)
    assert found(archive, after=last, **day) == ["c2"]
    assert [one.id for one in first] == ["c3"]


@pytest.mark.parametrize(
    ("query", "is_listed"),
    [
        ({}, True),
        ({"device": "left"}, True),
        ({"device": "right"}, False),
        ({"since_utc": "2026-03-06T09:00:00.000Z"}, True),
        ({"since_utc": "2026-03-06T09:00:00.001Z"}, False),
        ({"until_utc": "2026-03-06T09:00:00.001Z"}, True),
        ({"until_utc": "2026-03-06T09:00:00.000Z"}, False),
        ({"after": Position("2026-03-06T09:00:00.000Z", "livf")}, True),
        ({"after": Position("2026-03-06T09:00:00.000Z", "live")}, False),
        ({"search": "IN THE MAKING"}, True),
        ({"search": "day"}, False),
        ({"pinned": True}, True),
        ({"pinned": False}, False),
        ({"device": "left", "pinned": True, "search": "day"}, False),
    ],
)
def test_a_running_capture_is_listed_by_the_same_rules(
    archive: Archive, query: dict[str, object], is_listed: bool
) -> None:
    changes = {
        "id": "live",
        "device": "left",
        "created_utc": "2026-03-06T09:00:00.000Z",
        "note": "in the making",
        "labels": {},
        "pinned": True,
    }
    live = archive.document("c5").model_copy(update=changes)
    archive.current = lambda: [live]  # type: ignore[method-assign]
    assert ("live" in found(archive, **query)) == is_listed


def test_a_running_capture_that_is_in_the_index_already_is_listed_once(archive: Archive) -> None:
    live = archive.document("c5")
    archive.current = lambda: [live]  # type: ignore[method-assign]
    assert found(archive) == ["c5", "c4", "c3", "c2", "c1"]


def test_the_last_page_says_that_it_is_the_last(archive: Archive) -> None:
    page, position = list_captures(archive, CaptureQuery(limit=3))
    assert ([one.id for one in page], position) == (
        ["c5", "c4", "c3"],
        Position("2026-03-03T09:00:00.000Z", "c3"),
    )
    page, end = list_captures(archive, CaptureQuery(limit=2, after=position))
    assert ([one.id for one in page], end) == (["c2", "c1"], None)


def test_a_capture_that_is_deleted_while_it_is_listed_is_left_out(archive: Archive) -> None:
    (archive.directory / "c3.grab").unlink()
    assert found(archive) == ["c5", "c4", "c2", "c1"]


@pytest.mark.parametrize("at_once", [1, 2, 4, 5, 6])
def test_all_are_listed_however_many_entries_are_read_at_once(
    archive: Archive, at_once: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("grabberd.service.archive.capture_list.AT_ONCE", at_once)
    assert found(archive) == ["c5", "c4", "c3", "c2", "c1"]


def test_a_list_that_is_read_at_once_opens_the_index_once(
    archive: Archive, monkeypatch: pytest.MonkeyPatch
) -> None:
    pages, page = [], archive.index.page
    monkeypatch.setattr(archive.index, "page", lambda *place: pages.append(place) or page(*place))
    found(archive)
    assert len(pages) == 1
