"""What a log of months says can be believed."""

from dataclasses import replace
from pathlib import Path

import pytest

from .log import Lived, Played, broken, read_lines, summary, write_line

PLAYED = Played("the disk is full", 12.0, 0.5, 1.25)
LIVED = Lived("killed", 60.0, 3, {"received": 900, "lost": 4}, [200.0] * 9, [40] * 9)


def test_an_entry_is_read_as_it_was_written(tmp_path: Path):
    for entry in (PLAYED, LIVED):
        write_line(tmp_path / "log", entry)
    assert read_lines(tmp_path / "log") == [PLAYED, LIVED]


def test_where_every_promise_was_kept_nothing_is_told():
    assert list(broken([PLAYED, LIVED])) == []


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        (replace(PLAYED, problems=["the state is lost"]), "12 s, the disk is full: the state is lost"),
        (
            replace(LIVED, problems=["an alarm stays: disk"]),
            "60 s, the daemon that was killed: an alarm stays",
        ),
        (replace(LIVED, memory_mb=[200.0, 210.0, 210.0, 220.0, 220.0, 220.0, 260.0, 270.0, 280.0]), "40 MB"),
        (replace(LIVED, descriptors=[40, 40, 40, 40, 40, 40, 60, 61, 62]), "20 more files are open"),
    ],
)
def test_a_broken_promise_is_told_with_its_time_and_on_a_busy_computer_as_a_doubt(entry, words):
    (told,) = broken([entry])
    assert words in told
    busy = replace(entry, was_busy=True)
    assert list(broken([busy])) == []
    assert list(broken([busy], was_busy=True)) == [told]


def test_memory_that_comes_back_has_not_grown():
    assert (
        list(
            broken(
                [replace(LIVED, memory_mb=[200.0, 210.0, 230.0, 220.0, 300.0, 210.0, 300.0, 225.0, 300.0])]
            )
        )
        == []
    )


def test_the_summary_counts_faults_fields_and_broken_promises():
    text = summary([PLAYED, replace(PLAYED, at_s=90.0, noticed_s=0.75), replace(LIVED, problems=["lost"])])
    assert "2 faults of 1 kinds in 2 minutes, 1 daemons" in text
    assert "3, with 4 fields lost, 900 fields received" in text
    assert "promises broken: 1;" in text
    assert "| the disk is full | 2 | 0.75 | 1.25 |" in text
