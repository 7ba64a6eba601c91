"""Captures that stay open between two requests are what is in their place, and are closed before long."""

import os
import shutil
import threading
import time
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from archive.captures import meta, points, slots, write
from grabberd import runtime
from grabberd.archive import capture_contents
from grabberd.archive.capture import content
from grabberd.archive.capture.groups import PointGroup, measured_points
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.runs import append_run
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.archive.capture_contents import KEPT_S, MOST, KeptReaders
from grabberd.core.reconstruction import Points
from grabberd.errors import CaptureFileError

FIELDS = 70
MANY = 2**40


class Clock:
    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def kept(clock: Clock) -> Iterator[KeptReaders]:
    readers = KeptReaders(clock)
    yield readers
    readers.close()


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    return write(tmp_path, slots(FIELDS), measured=range(FIELDS), fields_a_commit=25)


def reader_of(kept: KeptReaders, path: Path) -> CaptureReader:
    with kept.opened(path) as reader:
        return reader


def is_open(path: Path) -> bool:
    """True if this process has a descriptor of the file, whatever has become of its name."""
    links = (Path("/proc/self/fd") / name for name in os.listdir("/proc/self/fd"))
    return any(str(path) in os.readlink(link) for link in links if link.is_symlink())


def test_a_sealed_capture_is_opened_once(kept: KeptReaders, capture: Path) -> None:
    assert reader_of(kept, capture) is reader_of(kept, capture)


def test_a_capture_that_has_been_sealed_since_its_path_was_looked_up_is_found(
    kept: KeptReaders, capture: Path
) -> None:
    unsealed = capture.with_name(f"{capture.name}.part")
    assert reader_of(kept, unsealed).path == capture
    assert reader_of(kept, unsealed) is reader_of(kept, capture)


def test_a_capture_that_is_not_there_is_refused(kept: KeptReaders, tmp_path: Path) -> None:
    with pytest.raises(CaptureFileError, match="no capture file"), kept.opened(tmp_path / "gone.grab.part"):
        pass


def test_two_who_read_at_a_time_have_a_reader_each(kept: KeptReaders, capture: Path) -> None:
    with kept.opened(capture) as one, kept.opened(capture) as other:
        assert one is not other


@pytest.mark.parametrize("every", [1, 2, 7])
def test_fields_and_points_are_those_of_a_reader_of_its_own(
    kept: KeptReaders, capture: Path, every: int
) -> None:
    edges = (0, 1, 24, 25, 26, 49, 50, FIELDS - 1, FIELDS, MANY)
    for first_n, end_n in product(edges, edges):
        with kept.opened(capture) as reader, CaptureReader(capture) as fresh:
            ours, theirs = (list(one.timed_points(None, first_n, end_n, every)) for one in (reader, fresh))
            assert [one[:2] for one in ours] == [one[:2] for one in theirs]
            for (*_, own), (*_, other) in zip(ours, theirs, strict=True):
                np.testing.assert_array_equal(own.xyz_mm, other.xyz_mm)
            numbers = [[f.numbered.n for f in one.fields(first_n, end_n)] for one in (reader, fresh)]
            assert numbers[0] == numbers[1]


def test_a_field_that_is_kept_has_its_own_picture(kept: KeptReaders, capture: Path) -> None:
    for n in (3, 4, 30, 3):
        with kept.opened(capture) as reader, CaptureReader(capture) as fresh:
            np.testing.assert_array_equal(
                reader.field(n).numbered.packed.data, fresh.field(n).numbered.packed.data
            )


def test_another_capture_in_its_place_is_read_even_with_its_size_and_time(
    kept: KeptReaders, capture: Path, tmp_path: Path
) -> None:
    before = reader_of(kept, capture)
    was = capture.stat()
    copy = tmp_path / "copy"
    shutil.copy(capture, copy)
    copy.replace(capture)
    os.utime(capture, ns=(was.st_atime_ns, was.st_mtime_ns))
    assert capture.stat().st_size == was.st_size
    assert reader_of(kept, capture) is not before


def test_what_is_written_into_it_is_read_even_with_its_time(kept: KeptReaders, capture: Path) -> None:
    before = reader_of(kept, capture)
    was = capture.stat()
    while capture.stat().st_ctime_ns == was.st_ctime_ns:  # some kernels know the time to 10 ms only
        with capture.open("r+b") as file:
            file.write(b"SQLite format 3\0")
        os.utime(capture, ns=(was.st_atime_ns, was.st_mtime_ns))
    assert reader_of(kept, capture) is not before


def test_a_link_in_its_place_is_refused(kept: KeptReaders, capture: Path, tmp_path: Path) -> None:
    reader_of(kept, capture)
    capture.rename(tmp_path / "elsewhere.grab")
    capture.symlink_to(tmp_path / "elsewhere.grab")
    with pytest.raises(CaptureFileError, match="link"):
        reader_of(kept, capture)


def test_a_journal_that_names_other_files_is_refused_when_it_comes_later(
    kept: KeptReaders, capture: Path
) -> None:
    reader_of(kept, capture)
    journal = capture.with_name(capture.name + "-journal")
    journal.write_bytes(b"x" * 600 + bytes.fromhex("d9d505f920a163d7"))
    with pytest.raises(CaptureFileError, match="belongs to another database"):
        reader_of(kept, capture)
    assert not is_open(capture)


def test_one_that_is_gone_is_said_to_be_gone(kept: KeptReaders, capture: Path) -> None:
    reader_of(kept, capture)
    capture.unlink()
    with pytest.raises(CaptureFileError):
        reader_of(kept, capture)
    assert not is_open(capture)


def test_one_that_is_replaced_while_it_is_read_is_not_kept(
    kept: KeptReaders, capture: Path, tmp_path: Path
) -> None:
    with kept.opened(capture) as before:
        shutil.copy(capture, tmp_path / "copy")
        (tmp_path / "copy").replace(capture)
    assert not is_open(capture)
    assert reader_of(kept, capture) is not before


def test_runs_are_told_apart(kept: KeptReaders, capture: Path) -> None:
    append_run(capture, "measure", "", "", {}, ((n, points(n + 1)) for n in range(FIELDS)))
    for run, n in ((1, 3), (2, 3), (1, 3)):
        with kept.opened(capture) as reader, CaptureReader(capture) as fresh:
            ours, theirs = (list(one.timed_points(run, n, n + 1, 1)) for one in (reader, fresh))
            np.testing.assert_array_equal(ours[0][2].xyz_mm, theirs[0][2].xyz_mm)


def test_a_thinned_reading_decodes_no_group_without_a_wanted_field(
    kept: KeptReaders, capture: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    decoded: list[int] = []

    def counted(group: PointGroup) -> Points:
        decoded.append(group.first_n)
        return measured_points(group)

    monkeypatch.setattr(content, "measured_points", counted)
    with kept.opened(capture) as reader:
        numbers = [n for n, *_ in reader.timed_points(None, 0, FIELDS, 60)]
    assert (numbers, decoded) == ([0, 60], [0, 50])


def test_one_that_is_being_written_is_not_kept(kept: KeptReaders, tmp_path: Path) -> None:
    writer = CaptureWriter.create(path := tmp_path / "liner.grab.part", meta())
    writer.append(slots(FIELDS))
    writer.commit()
    assert reader_of(kept, path) is not reader_of(kept, path)
    writer.close()


def test_one_whose_reading_failed_is_closed(kept: KeptReaders, capture: Path) -> None:
    with pytest.raises(KeyError), kept.opened(capture):
        raise KeyError
    assert not is_open(capture)


def test_no_more_than_a_few_are_kept(kept: KeptReaders, capture: Path, tmp_path: Path) -> None:
    copies = [tmp_path / f"copy-{number}.grab" for number in range(MOST + 1)]
    for copy in copies:
        shutil.copy(capture, copy)
        reader_of(kept, copy)
    assert [is_open(copy) for copy in copies] == [False, *[True] * MOST]


def test_it_is_closed_when_it_has_not_been_asked_for_in_a_while(
    kept: KeptReaders, capture: Path, clock: Clock
) -> None:
    reader_of(kept, capture)
    clock.now_s += KEPT_S / 2
    reader_of(kept, capture)
    clock.now_s += KEPT_S / 2
    kept.close_old()
    assert is_open(capture)
    clock.now_s += KEPT_S / 2
    kept.close_old()
    assert not is_open(capture)


def test_a_thread_closes_it(capture: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(capture_contents, "KEPT_S", 0.01)
    reader_of(KeptReaders(), capture)
    until_s = time.monotonic() + 30
    while is_open(capture):
        assert time.monotonic() < until_s
        time.sleep(0.01)


def test_none_is_kept_where_no_thread_can_close_it(
    kept: KeptReaders, capture: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(thread: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    with monkeypatch.context() as full:
        full.setattr(runtime.Runtime, "start", staticmethod(refused))
        reader_of(kept, capture)
    assert not is_open(capture)
    assert reader_of(kept, capture) is reader_of(kept, capture)
