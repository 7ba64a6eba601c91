"""Analyses on disk: whole or not at all, never overwritten."""

import json

import pytest

from grabberd.errors import NotFound
from grabberd_liner.analyses.store import PAGE, RECORD, AnalysisStore


@pytest.fixture
def store(tmp_path):
    store = AnalysisStore(tmp_path / "analyses")
    store.open()
    return store


def add(store, capture_id="one", **record):
    with store.scratch() as folder:
        (folder / RECORD).write_text(json.dumps(record))
        return store.publish(capture_id, folder)


def left_over(store):
    return [path.name for path in store.directory.iterdir() if path.name.startswith(".")]


def test_each_gets_the_next_number_of_its_capture(store):
    assert [add(store), add(store), add(store, "two")] == [1, 2, 1]
    assert store.numbers("one") == [1, 2]
    assert store.numbers("three") == []


def test_the_newest_is_listed_first_with_its_number(store):
    add(store, run=1)
    add(store, run=2)
    assert list(store.records("one")) == [{"run": 2, "analysis": 2}, {"run": 1, "analysis": 1}]


def test_a_number_is_not_given_again_while_a_later_one_is_there(store):
    for _ in range(3):
        add(store)
    for path in (store.directory / "one" / "2").iterdir():
        path.unlink()
    (store.directory / "one" / "2").rmdir()
    assert add(store) == 4


def test_what_fails_while_it_is_written_leaves_nothing(store):
    with pytest.raises(TypeError):
        add(store, run={"not": {"JSON"}})
    assert store.numbers("one") == left_over(store) == []


def test_what_a_kill_left_is_cleared_away_by_the_next_one_and_by_the_next_start(store):
    for clear in (store.open, lambda: add(store)):
        (store.directory / ".part-killed").mkdir()
        (store.directory / ".part-killed" / RECORD).write_text("{}")
        clear()
        assert left_over(store) == []


def test_a_damaged_record_is_listed_with_what_is_wrong(store):
    add(store, run=1)
    add(store, run=1)
    (store.directory / "one" / "2" / RECORD).write_text("{")
    damaged, whole = store.records("one")
    assert (whole["analysis"], "problem" in whole) == (1, False)
    assert damaged["analysis"] == 2
    assert "record.json cannot be read" in damaged["problem"]


def test_a_record_of_another_form_is_listed_with_what_is_wrong(store):
    add(store, run="the first")
    row = store.row("one", 1)
    assert (row.analysis, row.run) == (1, None)
    assert "record.json cannot be read: Input should be a valid integer" in row.problem


def test_what_is_not_there_is_said_with_what_there_is(store):
    add(store)
    with pytest.raises(NotFound, match="one has no analysis 2"):
        store.file("one", 2, RECORD)
    with pytest.raises(NotFound, match=r"analysis 1 of capture one has no report\.html"):
        store.file("one", 1, PAGE)
    assert store.file("one", 1, RECORD).is_file()


def test_all_of_a_capture_go_with_it_and_those_of_others_stay(store):
    for capture_id in ("one", "one", "two"):
        add(store, capture_id)
    store.remove("one")
    store.remove("never analysed")
    assert (store.numbers("one"), store.numbers("two")) == ([], [1])
