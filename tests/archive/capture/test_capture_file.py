"""What was written into a capture file comes back."""

import json
import sqlite3
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from archive.captures import ledger_of, meta, same_field, slot, slots, write
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.schema import APPLICATION_ID
from grabberd.core.ledger import Outcome
from grabberd.errors import NotFound

# --- fields ---


@pytest.mark.parametrize(("bits", "doubled"), [(1, True), (1, False), (4, False), (8, False)])
def test_fields_come_back_as_they_went_in(tmp_path, bits, doubled):
    taken = slots(120, bits=bits, doubled=doubled)
    with CaptureReader(write(tmp_path, taken, bits=bits)) as reader:
        back = list(reader.received())
    assert len(back) == 120
    for one, other in zip(taken, back, strict=True):
        same_field(one.numbered, other)


def test_fields_can_be_read_from_anywhere_to_anywhere(tmp_path):
    with CaptureReader(write(tmp_path, slots(120))) as reader:
        assert [field.n for field in reader.received(49, 103)] == list(range(49, 103))
        assert list(reader.received(5, 0)) == []
        same_field(reader.field(77).numbered, slot(77).numbered)


def test_a_field_that_is_not_there_is_not_found(tmp_path):
    path = write(tmp_path, [slot(0), slot(5, lost=4)])
    with CaptureReader(path) as reader, pytest.raises(NotFound, match="has no field 3"):
        reader.field(3)


def test_damaged_fields_are_kept_and_told_apart(tmp_path):
    path = write(tmp_path, [slot(0), slot(1, Outcome.DAMAGED, "repeated"), slot(2)])
    with CaptureReader(path) as reader:
        assert [(f.outcome, f.reason) for f in reader.fields()][1] == (Outcome.DAMAGED, "repeated")
        assert [field.n for field in reader.received()] == [0, 2]
        assert reader.field_count == 3


def test_a_predicted_time_is_kept_with_its_field(tmp_path):
    told = "time predicted (zero timestamp)"
    with CaptureReader(write(tmp_path, [slot(0, reason=told)])) as reader:
        assert reader.field(0).reason == told
        assert reader.ledger.complete


def test_times_and_thresholds_are_whole_numbers_in_the_file(tmp_path):
    path = write(tmp_path, [slot(0)._replace(numbered=slot(0).numbered._replace(time_ns=np.int64(5)))])
    with CaptureReader(path) as reader:
        assert reader.field(0).numbered.time_ns == 5
        assert reader.first_time_ns == 5


# --- ledger and verdict ---


def test_the_ledger_comes_back_as_the_recorder_kept_it(tmp_path):
    taken = [
        *slots(3),
        slot(6, lost=3),
        slot(7, Outcome.NO_SIGNAL, "no signal"),
        slot(8, Outcome.DAMAGED, "repeated"),
        slot(9, Outcome.DAMAGED, "repeated"),
        slot(11, lost=1, lost_reason="unplugged"),
    ]
    with CaptureReader(write(tmp_path, taken)) as reader:
        assert reader.ledger == ledger_of(taken)
        assert not reader.meta.complete


def test_a_capture_with_every_field_is_complete(tmp_path):
    with CaptureReader(write(tmp_path, slots(64))) as reader:
        assert reader.meta.complete
        assert reader.meta.state == "sealed"
        assert reader.meta.ended_because == "length reached"
        assert reader.ledger.in_words(50.0) == "complete"


def test_the_ledger_can_be_read_before_the_end(part, writer):
    writer.append([slot(0), slot(3, lost=2), slot(4, Outcome.DAMAGED, "short buffer")])
    writer.commit()
    with CaptureReader(part) as reader:
        counts = reader.ledger.counts()
    assert counts[Outcome.RECEIVED] == 2
    assert counts[Outcome.LOST] == 2
    assert counts[Outcome.DAMAGED] == 1


# --- meta ---


def test_a_capture_says_what_it_is(tmp_path):
    with CaptureReader(write(tmp_path, slots(1))) as reader:
        assert reader.meta == meta(state="sealed", complete=True, ended_because="length reached")


def test_anybody_can_read_it_with_sqlite_and_json(tmp_path):
    connection = sqlite3.connect(write(tmp_path, slots(3)))
    assert connection.execute("PRAGMA application_id").fetchone()[0] == APPLICATION_ID
    values = {key: json.loads(value) for key, value in connection.execute("SELECT * FROM meta")}
    assert values["labels"] == {"cow": "1807", "teat": "front left"}
    assert connection.execute("SELECT count(*) FROM fields").fetchone() == (3,)
    connection.close()


def test_one_thread_after_the_other_may_read_on(tmp_path):
    path = write(tmp_path, slots(120))
    with CaptureReader(path) as reader, ThreadPoolExecutor(1) as pool:
        fields = reader.fields()
        found = [next(fields).numbered.n for _ in range(30)]
        found += pool.submit(lambda: [one.numbered.n for one in fields]).result()
    assert found == list(range(120))


def test_a_file_may_be_named_by_a_text(tmp_path):
    path = write(tmp_path, slots(3))
    with CaptureReader(str(path)) as reader:
        assert reader.path == path
        assert len(list(reader.received())) == 3
