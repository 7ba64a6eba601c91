"""Several files become one archive piece by piece; what is not whole is named in it."""

import io
import os
import zipfile
from collections.abc import Iterable
from datetime import datetime
from pathlib import Path

import pytest

from grabberd.archive.catalogue.capture_zip import MISSING, Member, zip_stream
from grabberd.errors import NotFound

NOON = datetime(2026, 3, 1, 12, 0, 0)
LONG = 3_000_000


def member(path: Path) -> Member:
    return Member(path.name, NOON, lambda: path, f"capture {path.stem}")


def gone() -> Path:
    raise NotFound("no capture 'b'", "look at the list")


def opened(pieces: Iterable[bytes]) -> zipfile.ZipFile:
    return zipfile.ZipFile(io.BytesIO(b"".join(pieces)))


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    for name, content in (("a.grab", b"a" * 10), ("long.grab", os.urandom(LONG))):
        (tmp_path / name).write_bytes(content)
    return [tmp_path / "a.grab", tmp_path / "long.grab"]


def test_files_come_whole_under_their_names_and_times(files: list[Path]) -> None:
    archive = opened(zip_stream([("captures.csv", "id\n")], map(member, files)))
    assert archive.testzip() is None
    assert archive.namelist() == ["captures.csv", "a.grab", "long.grab"]
    assert archive.read("long.grab") == files[1].read_bytes()
    assert archive.getinfo("a.grab").date_time == NOON.timetuple()[:6]


def test_pieces_are_small_however_long_a_file_is(files: list[Path]) -> None:
    sizes = [len(piece) for piece in zip_stream([], map(member, files))]
    assert sum(sizes) > LONG
    assert max(sizes) < 400_000


def test_a_file_that_is_gone_is_named_and_the_others_come(files: list[Path]) -> None:
    missing = Member("b.grab", NOON, gone, "capture b")
    away = member(files[0].with_name("away.grab"))
    archive = opened(zip_stream([], [missing, away, member(files[0])]))
    assert archive.namelist() == ["a.grab", MISSING]
    assert archive.read(MISSING).decode().splitlines() == [
        "capture b: no capture 'b'",
        "capture away: it cannot be read: No such file or directory",
    ]


def test_a_file_that_vanishes_while_it_is_sent_comes_whole(files: list[Path]) -> None:
    content = files[1].read_bytes()
    pieces = zip_stream([], map(member, files[1:]))
    first = [next(pieces), next(pieces)]
    files[1].unlink()
    archive = opened([*first, *pieces])
    assert archive.read("long.grab") == content
    assert archive.namelist() == ["long.grab"]


@pytest.mark.parametrize("change", [b"and more", None])
def test_a_file_that_is_changed_while_it_is_sent_is_named(files: list[Path], change: bytes | None) -> None:
    pieces = zip_stream([], map(member, files[1:]))
    first = next(pieces)
    if change is None:
        os.truncate(files[1], 1000)
    else:
        with files[1].open("ab") as file:
            file.write(change)
    archive = opened([first, *pieces])
    assert "capture long: it was changed while being sent" in archive.read(MISSING).decode()
