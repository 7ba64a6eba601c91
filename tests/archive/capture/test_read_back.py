"""What is written to a capture is read back; triggers of the connection stand for a disk that errs."""

import pytest

from archive.captures import ledger_of, points, slots, write
from grabberd.archive.capture import runs, schema
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.runs import append_run
from grabberd.errors import StorageError

OTHER_PICTURES = "UPDATE pictures SET data = substr(data, 1, 8) WHERE first_n = NEW.first_n"
OTHER_POINTS = "UPDATE points SET xyz_mm = substr(xyz_mm, 1, 8) WHERE first_n = NEW.first_n"


def spoil(connection, table, then, when="INSERT"):
    """Lets a connection do something else after every row that it writes to a table."""
    connection.execute(f"CREATE TEMP TRIGGER spoilt AFTER {when} ON main.{table} BEGIN {then}; END")


@pytest.mark.parametrize(
    ("table", "then", "words"),
    [
        ("pictures", OTHER_PICTURES, "the pictures of the fields 0 to 4 differ"),
        ("pictures", "DELETE FROM pictures", "the pictures of the fields 0 to 4 differ"),
        ("fields", "UPDATE fields SET time_ns = time_ns + 1 WHERE n = NEW.n", "field 0 differs"),
        ("fields", "UPDATE fields SET parity = 1 - parity WHERE n = NEW.n", "field 0 differs"),
        ("fields", "DELETE FROM fields WHERE n = NEW.n AND n = 3", "field 3 differs"),
    ],
)
def test_a_field_that_does_not_come_back_is_an_error_of_the_commit(writer, table, then, words):
    spoil(writer._connection, table, then)
    writer.append(slots(5))
    with pytest.raises(StorageError, match=f"does not read back as it was written: .*{words}") as raised:
        writer.commit()
    assert "check the disk" in raised.value.hint


@pytest.mark.parametrize("then", [OTHER_POINTS, "DELETE FROM points WHERE first_n = NEW.first_n"])
def test_points_that_do_not_come_back_are_an_error_of_the_commit(writer, then):
    spoil(writer._connection, "points", then)
    writer.append_points(1, 0, points(0))
    with pytest.raises(StorageError, match="does not read back as it was written"):
        writer.commit()


def test_everything_is_read_back_once(writer):
    writer.append(slots(5))
    writer.commit()
    spoil(writer._connection, "pictures", OTHER_PICTURES, when="UPDATE")
    writer.append(slots(10)[5:])
    writer.commit()
    writer.seal(ledger_of(slots(10)), complete=True, ended_because="stopped")


def test_a_ledger_that_does_not_come_back_keeps_the_file_unsealed(part, writer):
    writer.append(slots(5))
    writer.commit()
    spoil(writer._connection, "meta", "INSERT OR IGNORE INTO ledger VALUES (70, 2, 'lost', 'invented')")
    with pytest.raises(StorageError, match=r"its ledger says '.*2 fields lost"):
        writer.seal(ledger_of(slots(5)), complete=True, ended_because="stopped")
    assert part.exists()


def test_a_run_is_not_entered_unless_its_points_are_there(tmp_path, monkeypatch):
    path = write(tmp_path, slots(4), measured=range(4))

    def connect(path, **how):
        connection = schema.connect(path, **how)
        spoil(connection, "points", "DELETE FROM points WHERE first_n = NEW.first_n AND run = 2")
        return connection

    monkeypatch.setattr(runs, "connect", connect)
    with pytest.raises(StorageError, match="the points of field 0 differ"):
        append_run(path, "measure", "", "", {}, ((n, points(n)) for n in range(4)))
    with CaptureReader(path) as reader:
        assert [run.run for run in reader.runs] == [1]
        assert len(list(reader.points(1))) == 4
