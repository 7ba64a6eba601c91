"""A list of captures is bounded in bytes and time, whatever is in their files."""

import os
import threading
from pathlib import Path

import pytest
from hostile_captures import hostile, with_ledger, with_meta

from grabberd.archive.catalogue import capture_documents, capture_list
from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.catalogue.capture_documents import Descriptions, describe
from grabberd.archive.catalogue.capture_list import each_capture, list_captures
from grabberd.archive.catalogue.capture_query import CaptureQuery
from grabberd.documents.captures import CaptureDocument
from grabberd.errors import CaptureFileError
from grabberd.files.reading import check_patience


@pytest.fixture
def archive(tmp_path: Path) -> Archive:
    for k in range(5):
        hostile(tmp_path, f"c{k}", with_ledger(50, "b" * 400), with_meta(note="d" * 5000))
    archive = Archive(tmp_path, list, list)
    archive.index.rebuild()
    return archive


def all_pages(archive: Archive) -> list[list[str]]:
    pages, after = [], None
    while True:
        page = list_captures(archive, CaptureQuery(limit=100, after=after))
        pages.append([one.id for one in page.captures])
        after = page.found.after
        if after is None:
            return pages


def test_it_has_few_entries_of_each_capture(archive: Archive) -> None:
    page = list_captures(archive, CaptureQuery())
    assert [len(one.ledger.entries) for one in page.captures] == [10] * 5
    assert [one.ledger.entries_not_listed for one in page.captures] == [40] * 5


def test_a_page_ends_when_it_is_large(archive: Archive, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(capture_list, "LARGEST_PAGE", 30_000)
    assert all_pages(archive) == [["c4", "c3"], ["c2", "c1"], ["c0"]]
    monkeypatch.setattr(capture_list, "LARGEST_PAGE", 10)
    assert all_pages(archive) == [["c4"], ["c3"], ["c2"], ["c1"], ["c0"]]
    assert [one.id for one in each_capture(archive, CaptureQuery(limit=4))] == ["c4", "c3", "c2", "c1"]


def test_a_page_ends_when_it_takes_long_and_the_next_request_goes_on(
    archive: Archive, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(capture_list, "LONGEST_S", 0.0)
    assert all_pages(archive) == [["c4"], ["c3"], ["c2"], ["c1"], ["c0"]]
    assert all_pages(archive) == [["c4", "c3", "c2", "c1", "c0"]]


def test_several_who_want_one_description_wait_for_it(tmp_path: Path) -> None:
    path, begun, go_on, count = hostile(tmp_path, "one"), threading.Event(), threading.Event(), []

    def slow(path: Path) -> CaptureDocument:
        count.append(path)
        begun.set()
        assert go_on.wait(60)
        return describe(path)

    descriptions = Descriptions(slow)
    found: list[CaptureDocument] = []
    threads = [threading.Thread(target=lambda: found.append(descriptions.of(path))) for _ in range(4)]
    for thread in threads:
        thread.start()
    assert begun.wait(60)
    go_on.set()
    for thread in threads:
        thread.join()
    assert len(count) == 1
    assert all(one is found[0] for one in found)
    assert len(found) == 4


def test_descriptions_are_forgotten_by_their_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    paths = [hostile(tmp_path, f"c{k}", with_ledger(200, "b" * 400)) for k in range(3)]
    size = len(describe(paths[0]).model_dump_json())
    monkeypatch.setattr(capture_documents, "KEPT_BYTES", int(2.5 * size))
    count: list[Path] = []

    def counted(path: Path) -> CaptureDocument:
        count.append(path)
        check_patience()
        return describe(path)

    descriptions = Descriptions(counted)
    for path in (*paths, *paths[1:], paths[0]):
        descriptions.of(path)
    assert count == [*paths, paths[0]]


def test_a_damaged_file_is_read_again_only_when_it_has_changed(tmp_path: Path) -> None:
    path, count = hostile(tmp_path, "one", with_meta(bits=7)), []

    def counted(path: Path) -> CaptureDocument:
        count.append(path)
        return describe(path)

    descriptions = Descriptions(counted)
    for _ in range(3):
        with pytest.raises(CaptureFileError, match="bits is 7"):
            descriptions.of(path)
    assert len(count) == 1
    os.utime(path, ns=(1, 1))
    with pytest.raises(CaptureFileError):
        descriptions.of(path)
    assert len(count) == 2
