"""A backup is whole or refused, and a restore loses nothing."""

import json
import sqlite3
import stat
import threading
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from grabberd.archive.state.backup import MANIFEST, back_up, restore
from grabberd.archive.state.state_database import MIGRATIONS, StateStore, tables_of
from grabberd.errors import InputError, StorageError
from grabberd.files.disk import DirectoryLock

NOW = "20260301T093000Z"


def state_in(directory: Path, **values: object) -> StateStore:
    store = StateStore(directory / "state.sqlite")
    store.open()
    store.put(values)
    return store


def calibration_in(directory: Path, name: str, content: str) -> None:
    folder = directory / "calibrations" / name
    folder.mkdir(parents=True)
    (folder / "calibration.json").write_text(content)


def tree(directory: Path) -> dict[str, bytes]:
    files = (path for path in directory.rglob("*") if path.is_file())
    return {path.relative_to(directory).as_posix(): path.read_bytes() for path in files}


def make(directory: Path, out: Path) -> Path:
    back_up(directory, out, "2026-03-01T09:30:00.000Z", "0.1.0")
    return out


@pytest.fixture
def barn(tmp_path: Path) -> Path:
    """A state directory with something in it."""
    state_in(tmp_path / "barn", threshold=60)
    calibration_in(tmp_path / "barn", "rig-7", "one")
    return tmp_path / "barn"


@pytest.fixture
def backup(barn: Path, tmp_path: Path) -> Path:
    return make(barn, tmp_path / "barn.zip")


def test_what_was_backed_up_comes_back_and_what_was_there_is_kept(barn: Path, backup: Path) -> None:
    StateStore(barn / "state.sqlite").put({"threshold": 99})
    calibration_in(barn, "rig-8", "later")
    before = tree(barn)
    info, replaced = restore(barn, backup, NOW)
    assert (info.created_utc, info.version, info.calibrations) == ("2026-03-01T09:30:00.000Z", "0.1.0", 1)
    assert StateStore(barn / "state.sqlite").get("threshold") == 60
    assert [path.name for path in (barn / "calibrations").iterdir()] == ["rig-7"]
    assert replaced == barn / f"replaced-{NOW}"
    assert tree(replaced) == before


def test_an_empty_machine_takes_it_too(backup: Path, tmp_path: Path) -> None:
    _, replaced = restore(tmp_path / "new", backup, NOW)
    assert replaced is None
    assert StateStore(tmp_path / "new" / "state.sqlite").get("threshold") == 60
    assert (tmp_path / "new" / "calibrations" / "rig-7" / "calibration.json").read_text() == "one"


def test_secrets_are_readable_for_their_owner_alone(barn: Path, backup: Path) -> None:
    restore(barn, backup, NOW)
    for path in (backup, barn / "state.sqlite"):
        assert stat.S_IMODE(path.stat().st_mode) == 0o600


def test_it_is_of_one_moment_while_the_daemon_writes(barn: Path, tmp_path: Path) -> None:
    store, ended = StateStore(barn / "state.sqlite"), threading.Event()

    def write() -> None:
        count = 0
        while not ended.is_set():
            count += 1
            store.put({"left": count, "right": count})

    store.put({"left": 0, "right": 0})
    thread = threading.Thread(target=write)
    thread.start()
    try:
        files = [make(barn, tmp_path / f"{number}.zip") for number in range(3)]
    finally:
        ended.set()
        thread.join()
    for number, file in enumerate(files):
        restore(tmp_path / f"to-{number}", file, NOW)
        copy = StateStore(tmp_path / f"to-{number}" / "state.sqlite")
        assert copy.get("left") == copy.get("right") is not None


def test_a_directory_that_a_daemon_uses_is_refused(barn: Path, backup: Path) -> None:
    before = tree(barn)
    lock = DirectoryLock(barn)
    lock.acquire()
    with pytest.raises(StorageError, match="another grabberd"):
        restore(barn, backup, NOW)
    lock.release()
    assert {name: content for name, content in tree(barn).items() if name != ".lock"} == before


def test_nothing_is_overwritten(barn: Path, backup: Path) -> None:
    before = backup.read_bytes()
    with pytest.raises(StorageError, match="exists already"):
        make(barn, backup)
    assert backup.read_bytes() == before


def test_a_directory_without_a_state_has_no_backup(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match="cannot be backed up"):
        make(tmp_path, tmp_path / "out.zip")
    assert list(tmp_path.iterdir()) == []


def rewritten(backup: Path, change: Callable[[dict[str, bytes]], None]) -> None:
    with zipfile.ZipFile(backup) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    change(members)
    with zipfile.ZipFile(backup, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)


def with_manifest(**changes: object) -> Callable[[dict[str, bytes]], None]:
    def change(members: dict[str, bytes]) -> None:
        members[MANIFEST] = json.dumps({**json.loads(members[MANIFEST]), **changes}).encode()

    return change


def resigned(members: dict[str, bytes]) -> None:
    from hashlib import sha256  # noqa: PLC0415

    sums = {name: sha256(content).hexdigest() for name, content in members.items() if name != MANIFEST}
    with_manifest(sha256=sums)(members)


def state_of_version_99(members: dict[str, bytes]) -> None:
    with sqlite3.connect(":memory:") as connection:
        connection.deserialize(members["state.sqlite"])
        connection.execute("PRAGMA user_version = 99")
        connection.commit()
        members["state.sqlite"] = connection.serialize()
    resigned(members)


def garbage_as_state(members: dict[str, bytes]) -> None:
    members["state.sqlite"] = b"garbage " * 1000
    resigned(members)


def state_with(statement: str) -> Callable[[dict[str, bytes]], None]:
    def change(members: dict[str, bytes]) -> None:
        with sqlite3.connect(":memory:") as connection:
            connection.deserialize(members["state.sqlite"])
            connection.executescript(statement)
            members["state.sqlite"] = connection.serialize()
        resigned(members)

    return change


def a_large_member(members: dict[str, bytes]) -> None:
    members["calibrations/rig-7/page.html"] = bytes((64 << 20) + 1)
    resigned(members)


def many_members(members: dict[str, bytes]) -> None:
    members |= {f"calibrations/rig-{number}/a": b"" for number in range(10_001)}
    resigned(members)


def a_way_out(members: dict[str, bytes]) -> None:
    members["calibrations/../../passwd"] = b"x"
    resigned(members)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (with_manifest(schema="grabberd/backup/99"), "version 99"),
        (with_manifest(schema="somebody/else/1"), "not a backup"),
        (with_manifest(sha256={}), "not a backup"),
        (with_manifest(sha256=None), "not a backup"),
        (lambda members: members.update({"state.sqlite": b"another"}), "wrong members: state.sqlite"),
        (lambda members: members.pop("calibrations/rig-7/calibration.json"), "not a backup"),
        (lambda members: members.pop(MANIFEST), "not a backup"),
        (state_of_version_99, "version 99"),
        (garbage_as_state, "damaged"),
        (a_way_out, "wrong members"),
        (a_large_member, "rig-7/page.html has more than 67108864 bytes"),
        (many_members, "10003 members, more than 10000"),
        (with_manifest(deep=eval("[" * 50 + "]" * 50)), "nested in more than 40 levels"),
        (state_with("CREATE TRIGGER t AFTER INSERT ON tokens BEGIN DELETE FROM tokens; END"), "damaged"),
        (state_with("DROP TABLE tokens; CREATE VIEW tokens AS SELECT 1 AS hash"), "damaged"),
        (
            state_with("INSERT INTO settings VALUES ('deep', replace(hex(zeroblob(5000)), '0', '['))"),
            "damaged",
        ),
        (state_with("PRAGMA user_version = 0"), "its version is 0"),
    ],
)
def test_what_is_damaged_or_newer_is_refused_and_nothing_touched(
    barn: Path, backup: Path, change: Callable[[dict[str, bytes]], None], said: str
) -> None:
    before = tree(barn)
    rewritten(backup, change)
    with pytest.raises(InputError, match=said):
        restore(barn, backup, NOW)
    assert tree(barn) == before


def test_a_single_wrong_bit_anywhere_is_found(barn: Path, backup: Path) -> None:
    content, before = backup.read_bytes(), tree(barn)
    refused = 0
    for place in range(0, len(content), 5):
        backup.write_bytes(content[:place] + bytes([content[place] ^ 64]) + content[place + 1 :])
        try:
            restore(barn.with_name(f"to-{place}"), backup, NOW)
        except InputError:
            refused += 1
            assert not barn.with_name(f"to-{place}").exists()
        else:  # a bit that says nothing, such as a time in the archive's directory
            assert tree(barn.with_name(f"to-{place}"))["calibrations/rig-7/calibration.json"] == b"one"
    assert refused > len(content) / 5 / 2
    assert tree(barn) == before


def test_members_that_take_memory_to_unpack_are_refused(barn: Path, backup: Path) -> None:
    with zipfile.ZipFile(backup) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(backup, "w", zipfile.ZIP_LZMA) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    with pytest.raises(InputError, match="compressed by another method"):
        restore(barn, backup, NOW)


def test_what_could_not_be_restored_is_not_backed_up(barn: Path, tmp_path: Path) -> None:
    with (barn / "calibrations" / "rig-7" / "page.html").open("wb") as file:
        file.truncate((64 << 20) + 1)
    with pytest.raises(StorageError, match="can be restored"):
        make(barn, tmp_path / "too-large.zip")
    assert not (tmp_path / "too-large.zip").exists()


def test_states_of_all_earlier_versions_are_taken(barn: Path, backup: Path) -> None:
    for version in range(1, len(MIGRATIONS)):
        older = sqlite3.connect(":memory:")
        older.executescript(tables_of(version) + f"; PRAGMA user_version = {version}")
        rewritten(
            backup,
            lambda members, older=older: (
                members.update({"state.sqlite": older.serialize()}),
                resigned(members),
            ),
        )
        assert restore(barn, backup, f"{version}")[1] == barn / f"replaced-{version}"
        StateStore(barn / "state.sqlite").open()


def test_half_a_file_is_refused(barn: Path, backup: Path) -> None:
    backup.write_bytes(backup.read_bytes()[:-100])
    with pytest.raises(InputError, match="not a backup"):
        restore(barn, backup, NOW)
