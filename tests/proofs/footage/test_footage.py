"""A recording is read by its own truth or refused, and the proof of it would see if it were not."""

from dataclasses import replace
from pathlib import Path

import pytest

from grabberd.config import shipped_configs
from proofs.footage.containers import CONTAINERS, Container
from proofs.footage.faults import COUNT, DROPPED, FAULTS, NONE, Fault, frames
from proofs.footage.reading import Reading, camera, read
from proofs.footage.table import ALLOWED_MM, Cell, names

PAGE = shipped_configs().parent / "docs" / "reference" / "footage.md"
CONTAINER = {one.name: one for one in CONTAINERS}
FAULT = {one.name: one for one in FAULTS}
FOLDER, MP4, LOSSY = CONTAINER["folder of PNG, counted"], CONTAINER["MP4"], CONTAINER["MJPEG in AVI"]
DROPS, TURNED = FAULT["two pictures dropped"], FAULT["marked as turned by 90°"]
RIGHT = Reading(fields=80, complete=True, compared=6000, worst_mm=0.01)
WRONG = replace(RIGHT, worst_mm=5.0)


def failure(
    reading: Reading,
    container: Container = FOLDER,
    fault: Fault = DROPS,
    *,
    with_ffmpeg: bool = True,
    plain: Reading = RIGHT,
) -> str:
    return Cell(container, fault, with_ffmpeg, reading, plain).failure


def test_pictures_that_the_count_in_their_names_lacks_are_lost_and_all_others_right(tmp_path: Path) -> None:
    seen = camera(tmp_path, 2 * COUNT)
    path = FOLDER.write(tmp_path, frames(seen.fields, DROPS), DROPS)
    found = read(path, {}, seen.points, tmp_path / "read.grab")
    assert (found.refusal, found.fields, found.lost) == ("", 2 * (COUNT - len(DROPPED)), 2 * len(DROPPED))
    assert found.compared > 0
    assert found.worst_mm < ALLOWED_MM
    assert not found.complete


def test_an_error_without_a_remark_that_explains_it_is_a_failure() -> None:
    assert failure(RIGHT) == ""
    assert failure(WRONG) == "silently wrong by 5.00 mm"
    assert failure(replace(WRONG, remarks=("Nothing tells which field is the older.",)))
    assert not failure(replace(WRONG, remarks=("Its pictures are taken for consecutive ones.",)))


def test_that_nothing_was_measured_is_as_wrong() -> None:
    assert failure(replace(RIGHT, compared=0, worst_mm=0.0))


def test_a_lossy_codec_may_be_off_by_what_it_is_without_a_fault() -> None:
    off = replace(RIGHT, worst_mm=0.5)
    assert failure(off, LOSSY, plain=off) == ""
    assert failure(off, FOLDER, plain=off)
    assert failure(replace(RIGHT, worst_mm=0.9), LOSSY, plain=off)


def test_a_refusal_is_a_failure_where_it_must_be_read() -> None:
    refused = Reading(refusal="clip.mp4 has no readable video")
    assert failure(refused, MP4) == "not read: clip.mp4 has no readable video"
    assert failure(refused, MP4, with_ffmpeg=False) == ""
    assert failure(refused, MP4, TURNED) == ""
    assert failure(refused, FOLDER, NONE, with_ffmpeg=False)


@pytest.mark.parametrize("container", CONTAINERS, ids=[one.name for one in CONTAINERS])
def test_a_fault_that_a_container_cannot_have_is_said_why(container: Container) -> None:
    assert container.lacks(NONE) == ""
    assert container.timed != bool(container.lacks(FAULT["jitter of ±4 ms"]))


def test_the_page_has_every_container_and_every_fault() -> None:
    title, rows = "", []
    for line in PAGE.read_text("utf-8").splitlines():
        if line.startswith("## "):
            title = line.removeprefix("## ")
        elif line.startswith("| ") and not line.startswith(("| fault", "| scene")):
            rows.append((title, line.split(" | ")[0].removeprefix("| ")))
    known = {container.name: container.title for container in CONTAINERS}
    assert [one for one in rows if one[0] != "False alarms"] == [
        (known[name], fault) for name, fault in names()
    ]
