"""Damaged fields and those without a signal: kept with their pictures, marked, and left out of measuring."""

import csv
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from capturing import capture, replaying
from running import live

from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.export.field_pictures import export_png
from grabberd.archive.measure_setups import INCLUDE_DAMAGED
from grabberd.config import RingConfig
from grabberd.core.field import unpack
from grabberd.core.ledger import Outcome
from grabberd.library.jobs.measurement import measure_file

FIELDS = 120
FAULTS = [
    {"kind": "lose", "at_field": 20, "count": 3},
    {"kind": "damage", "at_field": 40, "count": 2},
    {"kind": "repeat", "at_field": 50, "count": 1},
    {"kind": "no_signal", "at_field": 60, "duration_s": 0.6, "picture": "blue", "told": False},
]
COUNTS = {Outcome.RECEIVED: 84, Outcome.LOST: 3, Outcome.DAMAGED: 3, Outcome.NO_SIGNAL: 30}


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A capture of all that goes wrong, from the very first field on."""
    folder = tmp_path_factory.mktemp("verdicts")
    with live(folder, {"faults": FAULTS}, ring=RingConfig(slots=256)) as service:
        made = capture(service, fields=FIELDS, pre_trigger_fields=200)
        document = service.archive.document(made.stem)
        assert document.fields == FIELDS - COUNTS[Outcome.LOST]
        yield made


def outcomes(path: Path) -> Counter[Outcome]:
    with CaptureReader(path) as reader:
        return Counter({outcome: count for outcome, count in reader.ledger.counts().items() if count})


def numbers_of(path: Path, *wanted: Outcome) -> list[int]:
    with CaptureReader(path) as reader:
        return [one.numbered.n for one in reader.fields() if one.outcome in wanted]


def measured(path: Path, run: int) -> list[int]:
    with CaptureReader(path) as reader:
        return [n for n, _ in reader.points(run)]


def test_all_of_them_are_in_the_file_with_their_pictures_and_marked(path: Path) -> None:
    assert outcomes(path) == COUNTS
    with CaptureReader(path) as reader:
        kept = list(reader.fields())
        assert Counter(one.outcome for one in kept) == {k: n for k, n in COUNTS.items() if k != Outcome.LOST}
        assert all(one.reason for one in kept if one.outcome is not Outcome.RECEIVED)
        assert reader.field_count == len(kept)
        blue = [unpack(one.numbered.packed).luma for one in kept if one.outcome is Outcome.NO_SIGNAL]
        damaged = [unpack(one.numbered.packed).luma for one in kept if one.outcome is Outcome.DAMAGED]
    assert all(len(np.unique(luma)) == 1 for luma in blue)
    assert all(len(np.unique(luma)) == 2 for luma in damaged)


def test_live_measuring_leaves_them_out(path: Path) -> None:
    assert measured(path, 1) == numbers_of(path, Outcome.RECEIVED)


def test_measuring_again_leaves_them_out_unless_it_is_told_otherwise(path: Path) -> None:
    with CaptureReader(path) as reader:
        made_with = dict(reader.run(1).made_with)
    good = measure_file(lambda _: None, path=path, made_with=made_with)
    made_with["settings"] = {**made_with["settings"], INCLUDE_DAMAGED: True}
    more = measure_file(lambda _: None, path=path, made_with=made_with)
    assert measured(path, good.run) == numbers_of(path, Outcome.RECEIVED)
    assert measured(path, more.run) == numbers_of(path, Outcome.RECEIVED, Outcome.DAMAGED)
    with CaptureReader(path) as reader:
        assert reader.run(more.run).made_with["settings"][INCLUDE_DAMAGED] is True
        assert INCLUDE_DAMAGED not in reader.run(good.run).made_with["settings"]


def test_their_pictures_are_exported_and_marked_with_a_ledger_beside_them(path: Path, tmp_path: Path) -> None:
    assert export_png(path, tmp_path / "pictures") == FIELDS - COUNTS[Outcome.LOST]
    with (tmp_path / "pictures" / "fields.csv").open(encoding="utf-8") as file:
        assert Counter(row["outcome"] for row in csv.DictReader(file)) == {
            str(outcome): count for outcome, count in COUNTS.items() if outcome is not Outcome.LOST
        }
    with (tmp_path / "pictures" / "ledger.csv").open(encoding="utf-8") as file:
        rows = [(row["first_n"], row["count"], row["outcome"], row["cause"]) for row in csv.DictReader(file)]
    assert rows == [
        ("20", "3", "lost", "cable"),
        ("40", "2", "damaged", "cable"),
        ("50", "1", "damaged", "content"),
        ("60", "30", "no_signal", "camera"),
    ]


def test_played_again_they_are_what_they_were(path: Path, tmp_path: Path) -> None:
    with replaying(tmp_path, path, pace="free") as service:
        again = capture(service, fields=FIELDS)
        assert outcomes(again) == COUNTS
