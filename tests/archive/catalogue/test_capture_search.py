"""Captures are searched by id, note and labels without opening the files of those that are not meant."""

from pathlib import Path

import pytest

from archive.captures import slots, write
from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.catalogue.capture_list import list_captures
from grabberd.archive.catalogue.capture_query import CaptureQuery, Position
from grabberd.archive.state.index_entries import IndexEntry
from grabberd.archive.state.state_database import Annotation
from grabberd.documents.captures import CaptureDocument
from grabberd.errors import StorageError

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
    return [one.id for one in list_captures(archive, CaptureQuery(**query)).captures]  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("search", "ids"),
    [
        ("day", ["c5", "c4", "c3", "c1"]),
        ("DAY 5", ["c5"]),
        ("101", ["c1"]),
        ("cow", ["c5", "c4", "c2", "c1"]),
        ("slipped", ["c2"]),
        ("rear right", ["c3"]),
        ("Right  rear", ["c3"]),
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

    def counted(entry: IndexEntry) -> CaptureDocument:
        opened.append(entry.id)
        return describe(entry)

    archive.listed = counted  # type: ignore[method-assign]
    assert found(archive, search="slipped") == ["c2"]
    assert opened == ["c2"]


def test_those_of_a_day_are_found_whatever_came_later(archive: Archive) -> None:
    day = {"since_utc": "2026-03-02T00:00:00.000Z", "until_utc": "2026-03-04T00:00:00.000Z"}
    assert found(archive, **day) == ["c3", "c2"]
    query = CaptureQuery(limit=1, **day)
    first = list_captures(archive, query)
    assert found(archive, after=first.found.after, **day) == ["c2"]
    assert [one.id for one in first.captures] == ["c3"]


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
    page = list_captures(archive, CaptureQuery(limit=3))
    assert [one.id for one in page.captures] == ["c5", "c4", "c3"]
    assert page.found.after == Position("2026-03-03T09:00:00.000Z", "c3")
    last = list_captures(archive, CaptureQuery(limit=2, after=page.found.after))
    assert ([one.id for one in last.captures], last.found.after) == (["c2", "c1"], None)


def test_totals_are_those_of_all_pages(archive: Archive) -> None:
    page = list_captures(archive, CaptureQuery(limit=1, search="day"))
    assert (len(page.captures), page.found.total, page.found.in_all) == (1, 4, 5)


def test_a_capture_that_is_deleted_while_it_is_listed_is_left_out(archive: Archive) -> None:
    (archive.directory / "c3.grab").unlink()
    assert found(archive) == ["c5", "c4", "c2", "c1"]


def test_a_capture_that_was_removed_by_hand_is_not_counted(archive: Archive) -> None:
    (archive.directory / "c3.grab").unlink()
    assert list_captures(archive, CaptureQuery()).found.total == 4


def test_what_is_said_of_a_capture_later_is_found_at_once(archive: Archive) -> None:
    assert found(archive, search="kicked") == []
    SAID["c1"] = Annotation(note="kicked off", pinned=True)
    try:
        archive.library.note("c1")
        assert found(archive, search="kicked", pinned=True) == ["c1"]
    finally:
        del SAID["c1"]


def test_a_capture_that_is_deleted_or_comes_changes_what_is_found(archive: Archive) -> None:
    assert len(found(archive)) == 5
    archive.remove("c2")
    changes = {"id": "c6", "created_utc": "2026-03-06T09:00:00.000Z"}
    archive.index.add(write(archive.directory, slots(2), name="c6", labels={"cow": "106"}, **changes))
    assert found(archive) == ["c6", "c5", "c4", "c3", "c1"]
    assert found(archive, labels={"cow": ("106", "105")}) == ["c6", "c5"]


def test_what_could_not_be_read_is_read_again(archive: Archive, monkeypatch: pytest.MonkeyPatch) -> None:
    found(archive)
    archive.library.note("c4")
    with monkeypatch.context() as broken:
        broken.setattr(archive.index, "some", _refuse)
        with pytest.raises(StorageError):
            found(archive)
    SAID["c4"] = Annotation(note="now it is known")
    try:
        assert found(archive, search="known") == ["c4"]
    finally:
        SAID["c4"] = Annotation(pinned=True)


def _refuse(ids: object) -> list[IndexEntry]:
    raise StorageError("the disk is away", "bring it back")


def test_a_long_list_that_is_shown_asks_the_index_once(
    archive: Archive, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked, some = [], archive.index.some
    found(archive)
    monkeypatch.setattr(archive.index, "some", lambda ids: asked.append(list(ids)) or some(ids))
    found(archive)
    assert asked == [["c5", "c4", "c3", "c2", "c1"]]
