"""Channels of a capture as CSV, Parquet and JSON."""

import csv
import io
import json
import sqlite3

import numpy as np
import pytest

from archive.captures import META, PERIOD_NS, START_NS, slots, write
from archive.readings import CHANNELS, SIGMA_NS, STEP_NS, readings, write_with_channels
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.export.channels_export import CHANNEL_COLUMNS, channels_csv
from grabberd.archive.export.page_documents import channels_json
from grabberd.archive.export.points_export import export_csv, export_parquet
from grabberd.archive.export.table_files import SEMICOLONS
from grabberd.bounded_documents import read_text
from grabberd.core.channels.account import AnomalyCount
from grabberd.errors import CaptureFileError
from grabberd.tables import Table, number_of

FIELDS = 60
READINGS = FIELDS * PERIOD_NS // STEP_NS


@pytest.fixture
def capture(tmp_path):
    return write_with_channels(tmp_path, slots(FIELDS), measured=range(FIELDS))


def rows(text):
    return list(csv.DictReader(io.StringIO(text)))


def test_every_reading_of_every_channel_is_a_row(capture):
    found = rows("".join(channels_csv(capture)))
    assert [one["channel"] for one in found] == ["pulsation"] * READINGS + ["liner"] * READINGS
    assert list(found[0]) == [column.name for column in CHANNEL_COLUMNS]
    value = [float(one["value"]) for one in found[:READINGS]]
    np.testing.assert_array_equal(value, readings(0, READINGS).value)


def test_a_row_has_kpa_and_what_they_go_by(capture):
    one, *_ = rows("".join(channels_csv(capture)))
    assert float(one["vacuum_kpa"]) == pytest.approx(101.3 - 0.1 * float(one["value"]))
    assert (one["sigma_vacuum_kpa"], one["unit"], one["logger"]) == ("0.2", "mbar", "tank")
    assert (one["dating"], float(one["sigma_time_s"])) == ("own_clock", SIGMA_NS / 1e9)
    assert one["time_utc"] == META.created_utc


def test_a_capture_without_channels_has_a_head_alone(tmp_path):
    assert rows("".join(channels_csv(write(tmp_path, slots(3))))) == []


def test_damaged_readings_are_told_before_the_first_text(capture):
    connection = sqlite3.connect(capture)
    connection.execute("UPDATE readings SET value = zeroblob(9) WHERE channel = 1 AND number = 2")
    connection.commit()
    connection.close()
    with pytest.raises(CaptureFileError, match="readings of liner, group 2"):
        channels_csv(capture)


def test_an_export_has_the_channels_beside_the_points(capture, tmp_path):
    pq = pytest.importorskip("pyarrow.parquet")
    export_csv(capture, tmp_path / "csv")
    export_parquet(capture, tmp_path / "parquet")
    text = rows((tmp_path / "csv" / "channels.csv").read_text())
    table = pq.read_table(tmp_path / "parquet" / "channels.parquet")
    assert table.column_names == [column.name for column in CHANNEL_COLUMNS]
    assert table["value"].to_pylist() == [float(one["value"]) for one in text]
    about = json.loads(table.schema.metadata[b"grabberd"])
    assert about["calibrations"]["pulsation"]["calibrated"] == "2026-02-03"


def test_an_export_for_decimal_commas_is_read_back_as_the_same_numbers(capture, tmp_path):
    """All files of the folder have the same signs: a spreadsheet program opens each of them, or none."""
    export_csv(capture, tmp_path / "points")
    export_csv(capture, tmp_path / "semicolons", dialect=SEMICOLONS)
    for name in ("points.csv", "channels.csv", "ledger.csv"):
        plain, other = (tmp_path / folder / name for folder in ("points", "semicolons"))
        assert other.read_bytes().startswith(b"\xef\xbb\xbf")
        columns, expected = _table(plain)
        assert _table(other) == (columns, expected)
        assert len(expected) > 1 or name == "ledger.csv"


def _table(path):
    """Columns of a file, and its rows; numbers as such, whatever their decimal sign."""
    table = Table(read_text(path), [("n", "channel", "first_n")])
    rows = [[(number_of(cell), cell) for cell in row] for _, row in table.rows()]
    return table.columns, [[cell if number is None else number for number, cell in row] for row in rows]


def test_an_export_without_channels_has_no_file_for_them(tmp_path):
    export_csv(write(tmp_path, slots(3), measured=range(3)), tmp_path / "csv")
    assert not (tmp_path / "csv" / "channels.csv").exists()


def test_the_document_has_every_kth_reading_and_what_is_missing(capture):
    document = json.loads(channels_json(capture, 100))
    assert (document["capture"], document["verdict"]) == (META.id, "complete")
    pulsation, liner = document["channels"]
    assert (pulsation["name"], pulsation["readings"]) == ("pulsation", READINGS)
    assert len(pulsation["time_s"]) == len(liner["kpa"]) == 80
    with CaptureReader(capture) as reader:
        whole = reader.channels.read("pulsation")
    np.testing.assert_allclose(pulsation["time_s"], whole.time_s[::3], atol=1e-6)
    np.testing.assert_allclose(pulsation["kpa"], whole.kpa[::3], atol=1e-4)
    assert pulsation["calibration"] == CHANNELS[0].calibration._asdict()
    assert pulsation["datings"] == ["own_clock"]


def test_the_document_has_gaps_and_anomalies_at_their_times(tmp_path):
    spoilt = (AnomalyCount("tank", "not a number", 3, 2, START_NS + 500_000_000, "4x2"),)
    path = write_with_channels(tmp_path, [*slots(25), *slots(100)[50:]], anomalies=spoilt)
    document = json.loads(channels_json(path, 100))
    assert document["verdict"] == "with gaps"
    (anomaly,) = document["anomalies"]
    assert anomaly == {
        "logger": "tank",
        "reason": "not a number",
        "times": 3,
        "lost": 2,
        "first_s": 0.5,
        "example": "4x2",
    }
    (gap,) = document["channels"][0]["gaps"]
    assert gap == {"first_s": 0.495, "last_s": 1.0, "reason": "no reading came"}


def test_the_document_of_a_capture_without_channels_says_so(tmp_path):
    document = json.loads(channels_json(write(tmp_path, slots(3)), 100))
    assert (document["verdict"], document["channels"]) == (None, [])
    assert document["in_words"] == "no channels were recorded"
