"""What a kill and a power cut leave of a folder."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from tests.proofs.world.disk import library

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="the library is compiled")
REPOSITORY = Path(__file__).parents[3]
_HEAD = """
import os, random, sqlite3, sys
from pathlib import Path
from tests.proofs.world.disk import Disk, Refusal
folder = Path(sys.argv[1]) / "folder"
folder.mkdir()
disk = Disk(folder)
disk.at(10**18)
disk.begin(random.Random(int(sys.argv[2])))
"""


def left(tmp_path, program, seed=1):
    """What a program prints."""
    environment = {**os.environ, "LD_PRELOAD": str(library()), "PYTHONPATH": str(REPOSITORY)}
    command = [sys.executable, "-c", _HEAD + program, str(tmp_path), str(seed)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


_WRITTEN = """
(folder / "whole").write_text("synced")
for one in (folder / "whole", folder):
    descriptor = os.open(one, os.O_RDONLY)
    os.fsync(descriptor)
    os.close(descriptor)
(folder / "loose").write_text("never synced")
disk.crash()
(folder / "later").write_text("after the crash")
disk.restart(power_cut={cut})
print(sorted((one.name, one.read_text()) for one in folder.iterdir()))
"""


def test_a_kill_leaves_all_that_was_written(tmp_path):
    found = left(tmp_path, _WRITTEN.format(cut=False))
    assert found == "[('loose', 'never synced'), ('whole', 'synced')]"


def test_a_power_cut_leaves_what_was_synchronised_and_some_of_the_rest(tmp_path):
    found = {
        left(folder, _WRITTEN.format(cut=True), seed)
        for seed in range(8)
        if (folder := tmp_path / f"{seed}").mkdir() is None
    }
    assert len(found) > 1
    assert all("('whole', 'synced')" in one and "later" not in one for one in found)
    assert any("loose" not in one for one in found)


def test_files_bear_the_simulated_time(tmp_path):
    found = left(tmp_path, "(folder / 'a').write_text('x'); print((folder / 'a').stat().st_mtime_ns)")
    assert int(found) == 10**18


_COMMITTED = """
connection = sqlite3.connect(folder / "a.sqlite", isolation_level=None)
connection.execute("PRAGMA journal_mode = PERSIST")
connection.execute("CREATE TABLE t (n INTEGER)")
last = 0
disk.crash_at(disk.commits + random.Random(int(sys.argv[2])).randint(0, 60))
while True:
    with connection:
        connection.execute("BEGIN")
        connection.executemany("INSERT INTO t VALUES (?)", [(last + 1,)] * 500)
        connection.execute("COMMIT")
    if disk.has_crashed:
        break
    last += 1
connection.close()
disk.restart(power_cut=True)
connection = sqlite3.connect(folder / "a.sqlite")
found = connection.execute("SELECT max(n), count(*) FROM t").fetchone()
whole = connection.execute("PRAGMA integrity_check").fetchone()[0]
print(whole, (found[0] or 0) - last, (found[1] - 500 * (found[0] or 0)))
"""


@pytest.mark.parametrize("seed", range(12))
def test_sqlite_loses_no_commit_that_returned(tmp_path, seed):
    """The one in which the crash was is there whole, or not at all."""
    assert left(tmp_path, _COMMITTED, seed) in ("ok 0 0", "ok 1 0")


def test_a_full_disk_refuses_growth_alone(tmp_path):
    program = """
(folder / "a").write_text("abc")
disk.refuse(Refusal.GROWTH, 28)
with (folder / "a").open("r+") as file:
    file.write("xyz")
try:
    (folder / "b").write_text("new")
except OSError as error:
    print(error.errno, (folder / "a").read_text())
"""
    assert left(tmp_path, program) == "28 xyz"
