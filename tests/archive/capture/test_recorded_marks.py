"""The marks of a capture file: as they were located, beside the fields, and nothing is taken for one."""

import json
import sqlite3
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from grabberd.archive.capture.content_digest import content_sha256
from grabberd.archive.capture.meta import CaptureMeta
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.core.field import Field, NumberedField, quantise
from grabberd.core.ledger import Ledger, Outcome, Slot
from grabberd.core.measurement.marks import Located
from grabberd.errors import CaptureFileError

META = CaptureMeta(
    id="marked",
    created_utc="2026-01-01T00:00:00+00:00",
    start_ns=0,
    device={"name": "one"},
    config={"marks": [{"x_px": 3.0, "y_px": 4.0}, {"x_px": 9.0, "y_px": 4.0}]},
    site={},
    labels={},
    note="",
    bits=1,
    lines="field",
    rate_hz=50.0,
    version="1",
)
FIELDS = 60


def located(n: int) -> Located:
    marks = np.random.default_rng(n).normal(5, 1, (2, 3)).astype(np.float32)
    if n % 7 == 0:
        marks[1] = np.nan
    return marks


def slot(n: int, marks: Located | None) -> Slot:
    packed = quantise(Field.intact(np.full((8, 16), n, np.uint8), n % 2), 1, 20)
    numbered = NumberedField(n, n * 20_000_000, n, packed.with_marks(marks))
    return Slot(numbered, n, Outcome.RECEIVED, None, (), numbered.time_ns)


def written(folder: Path, marks: Any = located, meta: CaptureMeta = META) -> Path:
    writer, ledger = CaptureWriter.create(folder / "marked.grab.part", meta), Ledger()
    writer.remember_marks([(n % 2, located(n)) for n in range(96)])
    for n in range(FIELDS):
        writer.append([slot(n, marks(n))])
        ledger.enter(n, Outcome.RECEIVED, None, ())
        if n % 25 == 24:
            writer.commit()
    return writer.seal(ledger, complete=True, ended_because="length reached")


def test_each_field_has_the_marks_that_were_located_in_it(tmp_path: Path) -> None:
    with CaptureReader(written(tmp_path)) as reader:
        fields = list(reader.received())
        assert [one.n for one in fields] == list(range(FIELDS))
        for one in fields:
            assert one.packed.marks is not None
            assert one.packed.marks.tobytes() == located(one.n).tobytes()
        assert [one.n for one in reader.received(30, 33)] == [30, 31, 32]
        assert next(reader.received(59)).packed.marks.tobytes() == located(59).tobytes()
        reader.check_unchanged()


def test_the_marks_before_the_first_field_are_kept_with_their_parities(tmp_path: Path) -> None:
    with CaptureReader(written(tmp_path)) as reader:
        before = reader.marks_before()
    assert [parity for parity, _ in before] == [n % 2 for n in range(96)]
    assert before[5][1].tobytes() == located(5).tobytes()


def test_fields_without_marks_have_none(tmp_path: Path) -> None:
    path = written(tmp_path, lambda n: located(n) if n < 30 else None)
    with CaptureReader(path) as reader:
        assert [one.packed.marks is None for one in reader.received()] == [n >= 30 for n in range(FIELDS)]
    (tmp_path / "plain").mkdir()
    with CaptureReader(written(tmp_path / "plain", lambda _: None, replace(META, config={}))) as reader:
        assert all(one.packed.marks is None for one in reader.received())


def test_they_belong_to_what_the_points_are_measured_from(tmp_path: Path) -> None:
    digests = set()
    for name, marks in (("a", located), ("b", lambda n: located(n + 1)), ("c", lambda _: None)):
        (tmp_path / name).mkdir()
        digests.add(content_sha256(written(tmp_path / name, marks), META))
    assert len(digests) == 3


@pytest.mark.parametrize(
    "change",
    [
        {"data": "!"},
        {"data": "AAAA"},
        {"marks": 0},
        {"marks": 10**9},
        {"n": ["0"]},
        {"n": list(range(1000))},
        {"n": None},
    ],
)
def test_damaged_marks_are_an_error(tmp_path: Path, change: dict[str, Any]) -> None:
    path = written(tmp_path)
    with sqlite3.connect(path) as connection:
        key, value = connection.execute("SELECT key, value FROM meta WHERE key GLOB 'marks.0*'").fetchone()
        broken = json.dumps({**json.loads(value), **change})
        connection.execute("UPDATE meta SET value = ? WHERE key = ?", (broken, key))
    with CaptureReader(path) as reader:
        with pytest.raises(CaptureFileError):
            list(reader.received())
        with pytest.raises(CaptureFileError, match="metadata"):
            reader.check_unchanged()
