"""Captures on their way to a central store: only sealed ones, and none goes that is not proven there."""

import json
import os
import shutil
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from archive.captures import slots, write
from server.api.daemons import serving

ROOT = Path(__file__).parents[2]
HERE = ROOT / "systemd" / "central-store"
UNITS = ("grabberd-upload.service", "grabberd-upload.timer")
DAY_S = 86_400

needs_rclone = pytest.mark.skipif(
    not (shutil.which("rclone") and shutil.which("curl")),
    reason="rclone or curl is missing: apt install them",
)


class Barn(NamedTuple):
    """A daemon with captures, and a store that is a folder."""

    url: str
    captures: Path
    store: Path

    def upload(self, **settings: str) -> "subprocess.CompletedProcess[str]":
        environment = {"PATH": os.environ["PATH"], "HOME": "/nonexistent", "CAPTURES": str(self.captures)}
        environment |= {"STORE": str(self.store), "URL": self.url, **settings}
        command = [HERE / "upload.sh"]
        return subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=120, check=False
        )

    def here(self) -> set[str]:
        return {path.stem for path in self.captures.glob("*.grab")}

    def there(self) -> set[str]:
        return {path.name for path in self.store.iterdir()}


@pytest.fixture
def barn(tmp_path: Path) -> Iterator[Barn]:
    """Three captures of forty days ago, and one of today."""
    captures = tmp_path / "state" / "captures"
    captures.mkdir(parents=True)
    for name in ("old", "older", "pinned", "new"):
        path = write(captures, slots(3), name=name, id=name)
        if name != "new":
            os.utime(path, times=(path.stat().st_mtime - 40 * DAY_S,) * 2)
    with serving(tmp_path / "state") as daemon:
        yield Barn(daemon.url, captures, tmp_path / "store")


@pytest.mark.skipif(not shutil.which("systemd-analyze"), reason="systemd-analyze is missing")
def test_systemd_accepts_the_units(tmp_path: Path) -> None:
    for name in UNITS:
        lines = (HERE / name).read_text().splitlines()
        there = ["ExecStart=/bin/true" if line.startswith("ExecStart=") else line for line in lines]
        (tmp_path / name).write_text("\n".join(there) + "\n")
    command = ["systemd-analyze", "verify", "--man=no", *(tmp_path / name for name in UNITS)]
    environment = os.environ | {"SYSTEMD_UNIT_PATH": f"{tmp_path}:"}
    result = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=120, check=False
    )
    assert (result.returncode, result.stdout + result.stderr) == (0, "")


def test_every_unit_says_where_it_belongs_and_starts_what_is_there() -> None:
    for name in (*UNITS, "upload.env"):
        assert (HERE / name).read_text().startswith("# Install as /etc/")
    assert "share/grabberd/systemd/central-store/upload.sh" in (HERE / UNITS[0]).read_text()
    assert os.access(HERE / "upload.sh", os.X_OK)


@needs_rclone
def test_rclone_and_curl_run_under_the_units_filters() -> None:
    sandbox = [sys.executable, ROOT / "tests/systemd/sandbox.py", HERE / UNITS[0]]
    for program in ("rclone", "curl"):
        command = [*sandbox, shutil.which(program) or "", "--version"]
        assert subprocess.run(command, capture_output=True, timeout=120, check=False).returncode == 0


@needs_rclone
def test_sealed_captures_are_copied_and_nothing_else(barn: Barn) -> None:
    (barn.captures / "live.grab.part").write_bytes(b"half")
    (barn.captures / "damaged").mkdir(exist_ok=True)
    (barn.captures / "damaged" / "bad.grab").write_bytes(b"bad")
    assert barn.upload().returncode == 0
    assert barn.there() == {"old.grab", "older.grab", "pinned.grab", "new.grab"}
    assert barn.here() == {"old", "older", "pinned", "new"}
    for path in barn.store.iterdir():
        assert path.read_bytes() == (barn.captures / path.name).read_bytes()


@needs_rclone
def test_only_what_is_old_proven_and_not_pinned_is_removed(barn: Barn) -> None:
    pin = urllib.request.Request(
        f"{barn.url}/api/v1/captures/pinned",
        json.dumps({"pinned": True}).encode(),
        {"Content-Type": "application/json"},
        method="PATCH",
    )
    urllib.request.urlopen(pin, timeout=10).close()
    assert barn.upload().returncode == 0
    copy = barn.store / "older.grab"
    known = copy.stat()
    content = bytearray(copy.read_bytes())
    content[5000] ^= 1  # same size, same time: only its content tells
    copy.write_bytes(content)
    os.utime(copy, ns=(known.st_atime_ns, known.st_mtime_ns))
    result = barn.upload(KEEP_DAYS="30")
    assert result.returncode != 0
    assert "none of these was removed" in result.stderr
    assert "pinned.grab: pinned, or worked on" in result.stdout
    assert barn.here() == {"older", "pinned", "new"}
    assert "old.grab" in barn.there()


@needs_rclone
def test_a_store_that_is_not_there_removes_nothing(barn: Barn) -> None:
    result = barn.upload(STORE="nowhere:herd", KEEP_DAYS="30")
    assert result.returncode != 0
    assert len(barn.here()) == 4
