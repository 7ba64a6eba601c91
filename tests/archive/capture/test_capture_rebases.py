"""Changes of what numbers and times go by, in a capture file: being written, sealed, and after a crash."""

import csv
import json
import sqlite3

import pytest

from archive.captures import META, ledger_of, slot, write
from grabberd.archive.capture.crash_recovery import recover
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.archive.export.field_pictures import export_png
from grabberd.core.ledger import Ledger, LedgerEvent, Rebase
from grabberd.errors import CaptureFileError

CLOCK = LedgerEvent(3, Rebase.CLOCK, "the clock of the timestamps was set by +3600.000 s")
PHASE = LedgerEvent(5, Rebase.PHASE, "the camera has gone on in the other phase")
SLOTS = [slot(n)._replace(rebases=tuple(one for one in (CLOCK, PHASE) if one.n == n)) for n in range(8)]


def ledger_with_events():
    ledger = ledger_of(SLOTS)
    ledger.events += [CLOCK, PHASE]
    return ledger


@pytest.fixture
def sealed(tmp_path):
    writer = CaptureWriter.create(tmp_path / "c.grab.part", META)
    writer.append(SLOTS)
    return writer.seal(ledger_with_events(), complete=True, ended_because="", findings={"rig": None})


def test_they_come_back_and_take_nothing_from_a_complete_capture(sealed):
    with CaptureReader(sealed) as reader:
        assert reader.ledger.events == [CLOCK, PHASE]
        assert reader.ledger.complete
        assert reader.meta.extra["rig"] is None
        words = reader.ledger.in_words(50.0)
    assert words == f"complete; {CLOCK.reason} at 0.06 s; {PHASE.reason} at 0.10 s"


def test_they_are_there_while_it_is_written_and_after_a_crash(tmp_path):
    writer = CaptureWriter.create(tmp_path / "c.grab.part", META)
    writer.append(SLOTS[:4])
    writer.commit()
    with CaptureReader(writer.path) as reader:
        assert reader.ledger.events == [CLOCK]
    writer.append(SLOTS[4:])
    writer.commit()
    writer.close()
    with CaptureReader(recover(writer.path)) as reader:
        assert reader.ledger.events == [CLOCK, PHASE]


def test_a_capture_without_any_says_nothing_of_them(tmp_path):
    with CaptureReader(write(tmp_path, [slot(n) for n in range(3)])) as reader:
        assert "rebases" not in reader.meta.extra
        assert reader.ledger == Ledger.restore(range(3), [])


def test_they_are_exported_with_the_ledger(sealed, tmp_path):
    export_png(sealed, tmp_path / "out")
    with (tmp_path / "out" / "ledger.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [(row["first_n"], row["count"], row["outcome"], row["cause"]) for row in rows] == [
        ("3", "0", "rebase", "clock"),
        ("5", "0", "rebase", "phase"),
    ]


@pytest.mark.parametrize("stored", [{"n": 3}, {"n": 3, "kind": "none", "reason": ""}, 7])
def test_damaged_ones_are_damage(sealed, stored):
    connection = sqlite3.connect(sealed)
    with connection:
        value = json.dumps({"rebases": [stored]})
        connection.execute("UPDATE meta SET value = ? WHERE key = 'extra'", (value,))
    connection.close()
    with pytest.raises(CaptureFileError), CaptureReader(sealed) as reader:
        _ = reader.ledger
