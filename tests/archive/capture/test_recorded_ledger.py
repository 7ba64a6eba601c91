"""The ledger of a file: the same however it is read, and in little memory however long it is."""

import sqlite3
import tracemalloc
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from hostile_captures import (
    LABELS,
    Inflated,
    hostile,
    with_extra,
    with_ledger,
    with_meta,
    with_rebases,
    with_runs,
)

from archive.captures import ledger_of, meta, slot, slots, write
from grabberd.archive.capture.meta import MOST_EVENTS, MOST_RUNS
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.recorded_ledger import Line, rebases_in
from grabberd.archive.capture.recorded_ledger import with_rebases as with_events
from grabberd.archive.capture.runs import append_run
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.archive.catalogue.capture_documents import describe
from grabberd.core.ledger import LedgerEvent, Outcome, Rebase, Slot
from grabberd.errors import CaptureFileError, StorageError

ENTRIES = 50_000
OUTCOMES = (Outcome.RECEIVED, Outcome.RECEIVED, Outcome.RECEIVED, Outcome.DAMAGED, Outcome.NO_SIGNAL)


def weather(seed: int) -> list[Slot]:
    """Fields of any outcome, with losses of any length between them."""
    rng = np.random.default_rng(seed)
    taken, n = [], int(rng.integers(3))
    for _ in range(60):
        lost = int(rng.integers(4)) * int(rng.integers(2))
        outcome = OUTCOMES[rng.integers(len(OUTCOMES))]
        reason = None if outcome is Outcome.RECEIVED else ("snow", "a line is shifted")[rng.integers(2)]
        n += lost
        taken.append(slot(n, outcome, reason, lost=lost))
        n += 1
    return taken


@pytest.mark.parametrize("seed", range(12))
def test_it_is_what_was_written(tmp_path: Path, seed: int) -> None:
    taken = weather(seed)
    expected = ledger_of(taken)
    with CaptureReader(write(tmp_path, taken)) as reader:
        assert reader.ledger == expected
        for most in (0, 3, 1000):
            short = reader.short_ledger(most)
            assert short.counts() == expected.counts()
            assert (short.total, short.complete) == (expected.total, expected.complete)
            assert short.entries[:most] == expected.entries[:most]
            assert short.unlisted + len(short.entries) == len(expected.entries)
        assert reader.short_ledger(7).in_words(50) == expected.in_words(50)


def test_of_an_unsealed_capture_damaged_fields_have_no_entries_yet(tmp_path: Path) -> None:
    taken = weather(3)
    writer = CaptureWriter.create(tmp_path / "liner.grab.part", meta())
    writer.append(taken)
    writer.commit()
    writer.close()
    with CaptureReader(writer.path) as reader:
        assert reader.ledger == ledger_of(taken)
        assert reader.short_ledger(2).counts() == ledger_of(taken).counts()


def test_what_is_between_entries_and_has_none_is_not_accounted_for(tmp_path: Path) -> None:
    path = hostile(tmp_path, "loose", with_ledger(5, first_n=8, step=2))
    with CaptureReader(path) as reader:
        whole, short = reader.ledger, reader.short_ledger(2)
    assert whole.counts()[Outcome.LOST] == short.counts()[Outcome.LOST] == 11
    assert (whole.received, whole.end_n) == (4, 17)


@pytest.mark.parametrize("limit", [1, 2, 7, 500])
def test_its_lines_come_page_by_page_each_once(tmp_path: Path, limit: int) -> None:
    path = hostile(tmp_path, "long", with_ledger(40), with_rebases(30))
    with CaptureReader(path) as reader:
        assert list(_paged(reader, limit)) == sorted(
            [*reader.ledger.entries, *rebases_in(reader.meta.extra)], key=lambda one: one[0]
        )


def _paged(reader: CaptureReader, limit: int) -> Iterator[Line]:
    n = passed = 0
    while lines := reader.ledger_lines(n, passed, limit):
        yield from lines
        last = lines[-1][0]
        passed = sum(one[0] == last for one in lines) + (passed if last == n else 0)
        n = last


def test_a_long_one_is_described_in_little_memory(tmp_path: Path) -> None:
    path = hostile(tmp_path, "long", with_ledger(ENTRIES), with_runs(100, {"id": "rig"}))
    describe(path)
    tracemalloc.start()
    document = describe(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 5e6
    assert len(document.model_dump_json()) < 100_000
    assert (len(document.ledger.entries), document.ledger.entries_not_listed) == (100, ENTRIES - 100)
    assert document.ledger.counts[Outcome.LOST] == ENTRIES // 2


def test_what_it_does_not_list_is_not_in_the_document_of_a_list(tmp_path: Path) -> None:
    document = describe(hostile(tmp_path, "long", with_ledger(300), with_rebases(200), with_runs(300)))
    assert (len(document.ledger.events), document.ledger.events_not_listed) == (100, 100)
    assert ([one.run for one in document.runs], document.runs_not_listed) == ([*range(201, 301)], 200)
    short = document.in_list
    assert (len(short.ledger.entries), short.ledger.entries_not_listed) == (10, 290)
    assert (len(short.ledger.events), short.ledger.events_not_listed) == (10, 190)
    assert ([one.run for one in short.runs], short.runs_not_listed) == ([*range(291, 301)], 290)
    assert short.ledger.counts == document.ledger.counts


REFUSED: dict[str, tuple[Inflated, str]] = {
    "runs": (with_runs(MOST_RUNS + 1), f"more than {MOST_RUNS} runs"),
    "rebases": (with_rebases(MOST_EVENTS + 1), "at most 10000 items"),
    "labels": (with_meta(labels=LABELS), "labels is .*they have more than 20000 characters"),
    "site": (with_meta(site=LABELS), "site is .*they have more than 20000 characters"),
    "configuration": (with_meta(config={"a": [0] * 100_000}), "config has more than 262144 characters"),
    "device": (with_meta(device={"name": "cup", "more": [0] * 100_000}), "device has more than"),
    "findings": (with_extra(later=[0] * 1_000_000), "extra has more than 2097152 characters"),
    "rig": (with_extra(rig={"a": [0] * 20_000}), "it has more than 20000 characters"),
    "coverage": (with_meta(**{"coverage.1": [0] * 1_000_000}), "coverage.1 has more than 2097152"),
    "channels": (with_meta(channels=[0] * 1_000_000), "channels has more than 2097152 characters"),
    "entries": (with_ledger(30_000, step=2), "30000 entries, which do not add up with its fields"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_more_than_a_capture_can_have_is_refused_with_its_reason(tmp_path: Path, case: str) -> None:
    inflate, reason = REFUSED[case]
    with pytest.raises(CaptureFileError, match=reason):
        describe(hostile(tmp_path, "much", inflate))


def test_no_more_runs_are_added_than_can_be_read(tmp_path: Path) -> None:
    path = hostile(tmp_path, "runs", with_runs(MOST_RUNS))
    with pytest.raises(StorageError, match=f"has {MOST_RUNS} runs"):
        append_run(path, "measure", "2026-03-01T09:30:00Z", "1", {}, [])


def test_of_too_many_rebases_the_last_that_is_listed_counts_the_others() -> None:
    events = [LedgerEvent(n, Rebase.COUNT, f"restarted {n}") for n in range(MOST_EVENTS + 5)]
    listed = rebases_in(with_events({}, events))
    assert listed[:-1] == events[: MOST_EVENTS - 1]
    assert listed[-1].n == MOST_EVENTS - 1
    assert listed[-1].reason.startswith("6 changes from here on, which are not listed; the first: restarted")
    assert rebases_in(with_events({}, events[:MOST_EVENTS])) == events[:MOST_EVENTS]


@pytest.mark.parametrize("value", [-(2**63), 2**63 - 1])
@pytest.mark.parametrize("column", ["n", "time_ns"])
def test_a_field_at_the_end_of_its_type_is_damage(tmp_path: Path, column: str, value: int) -> None:
    path = write(tmp_path, slots(3))
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute(f"UPDATE fields SET {column} = ? WHERE n = 2", (value,))
    with CaptureReader(path) as reader, pytest.raises(CaptureFileError, match="not a whole number from 0"):
        assert reader.length + reader.last_field[1]  # type: ignore[index]
