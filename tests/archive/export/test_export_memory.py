"""What is taken home of a long capture passes through memory in parts."""

import json
import sqlite3
import tracemalloc
from contextlib import closing

import pytest

from archive.captures import slots
from archive.first_format import write_first_format
from grabberd.archive.export.c3d_file import points_c3d
from grabberd.archive.export.page_documents import PointsQuery, points_json
from grabberd.archive.export.points_export import points_csv, points_ply

FIELDS = 2_000
MOST = 3 << 20
"""Bytes; a list of all points would take 10 MB, and one of all lines as much."""
_MORE = "WITH RECURSIVE more(n) AS (SELECT 3 UNION ALL SELECT n + 1 FROM more WHERE n < ?)"


@pytest.fixture(scope="module")
def long(tmp_path_factory):
    """Many fields alike, each with five points; without digests, as earlier versions wrote it."""
    path = write_first_format(tmp_path_factory.mktemp("long"), slots(3), measured=[0, 1, 2])
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("DELETE FROM meta WHERE key GLOB 'digest*'")
        connection.execute(
            f"{_MORE} INSERT INTO fields SELECT more.n, time_ns + 20000000 * more.n, NULL, parity, y0, "
            "y_step, rows, columns, bits, threshold, outcome, reason, codec, data FROM more "
            "JOIN fields ON fields.n = 2",
            (FIELDS - 1,),
        )
        connection.execute(
            f"{_MORE} INSERT INTO points SELECT run, more.n, count, data FROM more "
            "JOIN points ON points.n = 2",
            (FIELDS - 1,),
        )
    return path


def _peak(read):
    tracemalloc.start()
    try:
        result = read()
        return result, tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_a_table_of_many_fields_is_written_field_by_field(long):
    rows, peak = _peak(lambda: sum(part.count("\n") for part in points_csv(long, None)))
    assert rows >= FIELDS * 5
    assert peak < MOST


def test_a_cloud_of_many_fields_is_written_field_by_field(long):
    size, peak = _peak(lambda: sum(len(part) for part in points_ply(long, None, None)))
    assert size > FIELDS * 5 * 20
    assert peak < MOST


def test_markers_of_many_fields_are_written_frame_by_frame(long):
    size, peak = _peak(lambda: sum(len(part) for part in points_c3d(long, None)))
    assert size > FIELDS * 5 * 16
    assert peak < MOST


def test_a_document_has_no_more_points_than_were_asked_for(long):
    document, peak = _peak(lambda: points_json(long, PointsQuery(None, 0, 1 << 40, 1, 1000, ())))
    assert len(json.loads(document)["fields"]) < 300
    assert peak < MOST
