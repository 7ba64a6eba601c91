"""Captures on disk looked after, backed up and restored on the command line."""

import json
import os
import sqlite3
import time
from contextlib import closing
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from archive.captures import meta, slots, write
from archive.first_format import write_first_format
from grabberd.archive.capture.captures_folder import CapturesFolder
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.archive.state.state_database import Annotation, AnnotationStore, StateStore
from grabberd.archive.state.state_keeper import CAPTURES_FOLDER, StateBackups, origin_of
from grabberd.cli.app import app
from grabberd.cli.status import disk_words, fault_words
from grabberd.errors import StorageError
from grabberd.files.disk import DirectoryLock


@pytest.fixture
def barn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A state directory with settings and captures that are 5, 40 and 50 days old."""
    folder = tmp_path / "state"
    monkeypatch.setenv("STATE_DIRECTORY", str(folder))
    store = StateStore(folder / "state.sqlite")
    store.open()
    store.put({"threshold": 60})
    captures = folder / "captures"
    captures.mkdir()
    for day in (5, 40, 50):
        moment = f"{datetime.now(UTC) - timedelta(days=day):%FT%TZ}"
        path = write(captures, slots(2), fields_a_commit=1, name=f"d{day}", id=f"d{day}", created_utc=moment)
        os.utime(path, 2 * (time.time() - day * 86_400,))
    return folder


def run(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


def config_with(folder: Path, retention: str) -> Path:
    file = folder.parent / "barn.yaml"
    file.write_text(f"devices: {{one: {{driver: fake}}}}\nstorage: {{retention: {retention}}}\n")
    return file


def test_captures_are_verified_all_or_by_name(barn: Path) -> None:
    result = run("storage", "verify")
    assert result.exit_code == 0, result.output
    assert result.stdout.splitlines()[-1] == "3 captures, 0 damaged"
    path = barn / "captures" / "d40.grab"
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("UPDATE fields SET threshold = threshold + 1 WHERE n = 1")
    result = run("storage", "verify", path)
    assert result.exit_code == 65
    assert f"{path}: damaged: 1 sound field" in result.stdout
    assert "    field 1: it is not what was written" in result.stdout
    missing = run("storage", "verify", barn / "nothing.grab")
    assert missing.stdout.splitlines()[0] == f"{barn / 'nothing.grab'}: damaged"
    assert "no capture file" in missing.stdout
    result = run("storage", "verify", "--json")
    assert result.exit_code == 65
    assert [bool(one["damages"]) for one in json.loads(result.stdout)] == [True, False, False]


def test_a_backup_comes_back(barn: Path, tmp_path: Path) -> None:
    out = tmp_path / "barn.zip"
    assert run("backup", "--out", out).exit_code == 0
    StateStore(barn / "state.sqlite").put({"threshold": 99})
    result = run("restore", out, "--json")
    assert result.exit_code == 0, result.output
    assert StateStore(barn / "state.sqlite").get("threshold") == 60
    replaced = Path(json.loads(result.stdout)["replaced"])
    assert StateStore(replaced / "state.sqlite").get("threshold") == 99
    assert "the previous state is kept" in run("restore", out).stdout


def test_while_a_daemon_runs_a_backup_is_made_and_a_restore_refused(barn: Path, tmp_path: Path) -> None:
    lock = DirectoryLock(barn)
    lock.acquire()
    try:
        assert run("backup", "--out", tmp_path / "barn.zip").exit_code == 0
        for words in (("restore", tmp_path / "barn.zip"), ("storage", "index")):
            error = run(*words).exception
            assert isinstance(error, StorageError)
            assert "another grabberd" in error.message
    finally:
        lock.release()


def test_the_index_is_made_again_from_the_files(barn: Path) -> None:
    (barn / "captures" / "index.sqlite").write_bytes(b"garbage " * 1000)
    (barn / "captures" / "d40.grab").write_bytes(b"garbage " * 1000)
    CaptureWriter.create(barn / "captures" / "cut.grab.part", meta(id="cut")).close()
    entries = json.loads(run("storage", "index", "--json").stdout)
    states = {entry["id"]: entry["state"] for entry in entries}
    assert states == {"cut": "sealed", "d5": "sealed", "d40": "damaged", "d50": "sealed"}
    result = run("storage", "index")
    assert "4 captures, 1 damaged" in result.stdout
    assert "damaged/d40.grab" in result.stdout


def test_a_dry_run_shows_what_would_go_and_removes_nothing(barn: Path) -> None:
    AnnotationStore(barn / "state.sqlite").put("d50", Annotation(pinned=True))
    config = config_with(barn, "{keep_days: 30}")
    found = json.loads(run("storage", "retention", "--config", config, "--json").stdout)
    assert [(one["id"], one["because"]) for one in found] == [("d40", "older than 30 days")]
    assert (
        "1 of 2 captures would be deleted, 1 are pinned"
        in run("storage", "retention", "--config", config).stdout
    )
    assert len(list((barn / "captures").glob("*.grab"))) == 3


def test_without_a_policy_it_says_so(barn: Path) -> None:
    result = run("storage", "retention", "--config", config_with(barn, "{}"))
    assert "not configured; 0 of 3 captures would be deleted" in result.stdout


def test_a_reserve_that_retention_never_reaches_is_refused(barn: Path) -> None:
    config = config_with(barn, "{min_free_gb: 0.1}")
    assert "must be more than reserve_gb" in str(run("check-config", config).exception)


def test_what_a_killed_capture_left_is_named_by_the_next_and_sealed(barn: Path, tmp_path: Path) -> None:
    folder = tmp_path / ".grabberd-abc"
    folder.mkdir()
    writer = CaptureWriter.create(folder / "old.grab.part", meta())
    writer.append(slots(5))
    writer.commit()
    writer.close()
    config = tmp_path / "fast.yaml"
    config.write_text("devices: {one: {driver: fake, options: {scene: liner, pace: free}}}\n")
    result = run("capture", "--config", config, "--fields", 3, "--out", tmp_path / "new.grab")
    assert result.exit_code == 0, result.output
    assert f"grabberd storage seal {folder / 'old.grab.part'}" in result.stderr
    result = run("storage", "seal", folder / "old.grab.part")
    assert "old.grab: 5 fields" in result.stdout
    assert {path.name for path in tmp_path.glob("*.grab")} == {"new.grab", "old.grab"}
    assert not folder.exists()


def test_the_status_says_what_is_left_or_what_is_wrong() -> None:
    storage = {"free_bytes": 12_340_000_000, "minutes_left": 345.6, "problem": None}
    assert disk_words(storage) == "disk: 12.3 GB free, 346 minutes of capture left"
    broken = {"free_bytes": None, "minutes_left": None, "problem": "captures cannot be written: gone"}
    assert disk_words(broken) == "disk: captures cannot be written: gone"


def test_recovered_settings_are_accepted_by_a_command(barn: Path) -> None:
    backups = StateBackups(barn)
    backups.back_up(datetime(2026, 3, 1, 9, 30, tzinfo=UTC))
    (barn / "state.sqlite").write_bytes(b"garbage " * 1000)
    backups.recover("file is not a database", datetime.now(UTC))
    result = run("storage", "accept", "--json")
    assert json.loads(result.stdout) == {"accepted": ["settings of 2026-03-01T09:30:00.000Z"]}
    assert origin_of(StateStore(barn / "state.sqlite")) is None
    assert "nothing to accept" in run("storage", "accept").stdout


def test_a_restored_backup_brings_no_folder_of_captures_with_it(barn: Path, tmp_path: Path) -> None:
    store = StateStore(barn / "state.sqlite")
    store.put({CAPTURES_FOLDER: "that of another computer"})
    assert run("backup", "--out", tmp_path / "barn.zip").exit_code == 0
    assert run("restore", tmp_path / "barn.zip").exit_code == 0
    folder = CapturesFolder(barn / "captures", lambda: store.get(CAPTURES_FOLDER))
    assert folder.take()
    folder.release()


def test_the_index_is_left_to_a_daemon_that_waits_for_its_folder(barn: Path) -> None:
    lock = DirectoryLock(barn)
    lock.acquire()
    (barn / "captures").rename(barn / "away")
    assert isinstance(run("storage", "index").exception, StorageError)
    assert not (barn / "captures").exists()
    lock.release()


@pytest.mark.parametrize("words", [("add", "tablet", "--role", "viewer"), ("list",), ("remove", "tablet")])
def test_no_token_is_put_into_a_new_state_in_place_of_one_that_is_gone(
    barn: Path, words: tuple[str, ...]
) -> None:
    StateBackups(barn).back_up(datetime.now(UTC))
    (barn / "state.sqlite").unlink()
    error = run("token", *words).exception
    assert isinstance(error, StorageError)
    assert "start the daemon" in error.hint
    assert not (barn / "state.sqlite").exists()


def test_the_status_has_a_line_for_each_fault_of_the_daemon() -> None:
    fault = {"level": "fault", "since_utc": "2026-03-01T09:30:00.000Z", "message": "gone", "hint": "mount it"}
    assert fault_words([fault]) == ["fault since 2026-03-01T09:30:00.000Z: gone; mount it"]
    assert fault_words([]) == []


def test_captures_are_converted_or_kept(barn: Path) -> None:
    captures = barn / "captures"
    old = write_first_format(captures, slots(20), name="old", id="old")
    broken = write_first_format(captures, slots(20), name="broken", id="broken")
    with closing(sqlite3.connect(broken)) as connection, connection:
        connection.execute("UPDATE fields SET threshold = threshold + 1 WHERE n = 1")
    before = old.stat().st_size
    result = run("storage", "convert", old)
    assert result.exit_code == 0, result.output
    now = old.stat().st_size
    assert result.stdout == f"{old}: converted, {before / 1e3:.0f} kB before, {now / 1e3:.0f} kB now\n"
    result = run("storage", "convert")
    assert result.exit_code == 65
    assert f"{broken}: kept as it is: " in result.stdout
    assert "field 1: it is not what was written" in result.stdout
    assert f"{old}: has today's format already" in result.stdout
    documents = json.loads(run("storage", "convert", old, broken, "--json").stdout)
    assert [document["file"] for document in documents] == [str(old), str(broken)]
    assert documents[0]["before_bytes"] == documents[0]["after_bytes"]
    assert documents[1]["hint"]


def test_before_a_daemon_has_run_retention_would_delete_nothing(tmp_path, monkeypatch):
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path / "none" / "state"))
    result = run("storage", "retention")
    assert result.exit_code == 0, result.exception
    assert "0 of 0 captures" in result.output
