"""The documents of a run's coverage, from what its file says; files of earlier versions say nothing."""

from pathlib import Path
from typing import get_args

import pytest

from archive.captures import MADE_WITH, slots, write
from grabberd.archive.capture.runs import append_run
from grabberd.archive.catalogue.capture_documents import describe, whole_coverage, whole_run
from grabberd.core.reconstruction.points import Miss
from grabberd.documents.captures import MissReason, UnexpectedReason

STORED = {
    "verdict": "measured_with_gaps",
    "findings": [
        {
            "verdict": "measured_with_gaps",
            "code": "targets_missed",
            "values": {"poor": 1.0, "targets": 2.0, "target": 7.0, "share": 0.259, "displaced_mm": 0.39},
            "miss": "off_place",
        }
    ],
    "share": 0.63,
    "fields": 100,
    "missing_fields": 0,
    "residual_px": 0.06,
    "residual_sigma": 0.8,
    "targets": {
        "target": [5, 7],
        "expected": [100, 100],
        "misses": {"off_place": [0, 70], "no_blob_left": [0, 4]},
        "unexpected": {"turned_away": [0, 3], "merged": [0, 0]},
        "found": [100, 26],
        "offset_mm": [[0.01, 0.39], [0.0, 0.0], [0.0, None]],
        "offset_sigma_mm": [0.02, 0.03],
        "offset_fields": [9, 9],
        "displaced": [False, False],
    },
    "worst_fields": [{"n": 3, "expected": 2, "found": 1, "residual_px": None}],
}


def test_a_finding_is_a_sentence() -> None:
    document = whole_coverage(STORED)
    assert document is not None
    assert document.in_words == (
        "1 of 2 targets were often missed; target 7 was found in 25 % of its fields: it is 0.4 mm from "
        "its place in the object file"
    )


def test_every_target_has_its_counts_and_its_chief_reason() -> None:
    document = whole_coverage(STORED)
    assert document is not None
    fine, poor = document.targets
    assert (fine.reason, fine.misses, fine.in_words) == (None, {}, "")
    assert (poor.found, poor.reason) == (26, "off_place")
    assert poor.misses == {"off_place": 70, "no_blob_left": 4}
    assert (fine.unexpected, poor.unexpected) == ({}, {"turned_away": 3})
    assert (poor.offset_x_mm, poor.offset_z_mm) == (0.39, None)


def test_a_capture_has_the_coverage_of_its_newest_run(tmp_path: Path) -> None:
    path = write(tmp_path, slots(2), measured=[0], coverage={1: {**STORED, "verdict": "not_measured"}})
    append_run(path, "measure", "2026-03-02T00:00:00Z", "0", MADE_WITH, [], lambda: STORED)
    document = describe(path)
    assert [run.coverage and run.coverage.verdict for run in document.runs] == [
        "not_measured",
        "measured_with_gaps",
    ]
    assert document.coverage == document.runs[1].coverage
    assert document.verdict == "complete"
    run = whole_run(path, 2)
    assert run.coverage is not None
    assert len(run.coverage.targets) == 2


@pytest.mark.parametrize("measured", [[], [0]])
def test_a_file_that_says_nothing_of_it_has_none(tmp_path: Path, measured: list[int]) -> None:
    path = write(tmp_path, slots(2), measured=measured)
    assert describe(path).coverage is None
    assert all(run.coverage is None for run in describe(path).runs)
    if measured:
        assert whole_run(path, 1).coverage is None


def test_the_document_knows_every_reason() -> None:
    missed, unexpected = (set(get_args(one.__value__)) for one in (MissReason, UnexpectedReason))
    assert missed | unexpected == {one.key for one in Miss if one is not Miss.FOUND}
    assert not missed & unexpected


def test_runs_of_earlier_versions_say_nothing_of_what_was_not_expected() -> None:
    targets = {name: column for name, column in STORED["targets"].items() if name != "unexpected"}
    document = whole_coverage({**STORED, "targets": targets})
    assert document is not None
    assert [one.unexpected for one in document.targets] == [{}, {}]
