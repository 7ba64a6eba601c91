"""Guided tests on disk: whole or not at all, under the id of the job that made them."""

import pytest

from grabberd.errors import NotFound, StorageError
from grabberd_liner.guided_tests.store import DOCUMENT, PAGE, LinerTestStore

TEST = """{"schema": "grabberd/liner-test/1", "kind": "ramp", "liner": "A", "captures": [],
 "created_utc": "2026-03-01T09:30:00.000Z", "version": "1", "verdict": "passed", "checks": [],
 "quantities": []}"""


@pytest.fixture
def store(tmp_path):
    store = LinerTestStore(tmp_path / "tests")
    store.open()
    return store


def add(store, test_id, text=TEST):
    with store.scratch() as folder:
        (folder / DOCUMENT).write_text(text)
        store.publish(test_id, folder)


def test_a_test_is_found_by_its_job_and_read_back(store):
    add(store, "job-7")
    assert store.made_by("job-7") == "job-7"
    assert store.made_by("job-8") is None
    assert store.document("job-7").kind == "ramp"


def test_the_newest_comes_first(store):
    for test_id in ("job-9", "job-10", "job-8"):
        add(store, test_id)
    assert store.ids() == ["job-10", "job-9", "job-8"]


def test_what_does_not_exist_is_said(store):
    add(store, "job-7")
    for test_id, name in (("job-1", DOCUMENT), ("../tests", DOCUMENT), ("job-7", PAGE)):
        with pytest.raises(NotFound):
            store.file(test_id, name)


def test_a_damaged_one_is_refused(store):
    add(store, "job-7", "{")
    with pytest.raises(StorageError, match=r"test\.json cannot be read"):
        store.document("job-7")


def test_no_test_is_overwritten(store):
    add(store, "job-7")
    with pytest.raises(StorageError):
        add(store, "job-7")


def test_what_fails_while_it_is_written_leaves_nothing(store):
    with pytest.raises(TypeError):
        add(store, "job-7", None)
    assert store.ids() == []
    assert list(store.directory.iterdir()) == []
