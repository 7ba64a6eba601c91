"""The store of calibrations: what is in it stays as it is."""

import json
import os
import stat
from pathlib import Path
from typing import Any

import pytest
from calibrators import calibration

from archive.damage import damage, every_way
from grabberd.archive.state.calibration_store import CalibrationRecord, CalibrationStore
from grabberd.errors import Conflict, InputError, NotFound, StorageError


@pytest.fixture
def store(tmp_path: Path) -> CalibrationStore:
    store = CalibrationStore(tmp_path / "calibrations")
    store.open()
    return store


def files_of(store: CalibrationStore) -> dict[str, bytes]:
    return {
        str(path.relative_to(store.directory)): path.read_bytes()
        for path in store.directory.rglob("*")
        if path.is_file()
    }


def test_a_stored_calibration_comes_back_as_it_was(store: CalibrationStore) -> None:
    document = calibration("rig-7")
    store.add(document, CalibrationRecord("cup", "import", "2026-05-01T00:00:00Z", "new mirrors"))
    entry = store.get("rig-7")
    assert entry.document == document
    assert entry.id == "rig-7"
    assert (entry.record.device, entry.record.note) == ("cup", "new mirrors")
    assert json.loads(store.content("rig-7")) == document


def test_its_report_lies_beside_it(store: CalibrationStore) -> None:
    store.add(calibration("rig-7"), report={"id": "rig-7"}, page="<p>σ</p>")
    report = store.report("rig-7")
    assert report is not None
    assert json.loads(report) == {"id": "rig-7"}
    assert store.page("rig-7") == "<p>σ</p>".encode()
    store.add(calibration("rig-8"))
    assert (store.report("rig-8"), store.page("rig-8")) == (None, None)


def test_the_same_id_is_refused_and_nothing_changes(store: CalibrationStore) -> None:
    store.add(calibration("rig-7"), report={"id": "rig-7"})
    before = files_of(store)
    with pytest.raises(Conflict, match="rig-7"):
        store.add(calibration("rig-7", shift_mm=1.0), page="<p>another</p>")
    assert files_of(store) == before


def test_its_files_are_read_only(store: CalibrationStore) -> None:
    store.add(calibration("rig-7"), report={}, page="")
    modes = {stat.S_IMODE(path.stat().st_mode) for path in (store.directory / "rig-7").iterdir()}
    assert modes <= {0o444, 0o440, 0o400}


@pytest.mark.parametrize(
    "damage",
    [
        lambda folder: (folder / "calibration.json").write_bytes(b"{"),
        lambda folder: (folder / "calibration.json").write_bytes(b"\xff\xfe"),
        lambda folder: (folder / "calibration.json").write_bytes(b"[" * 100_000),
        lambda folder: (folder / "calibration.json").unlink(),
        lambda folder: (folder / "record.json").unlink(),
        lambda folder: (folder / "record.json").write_bytes(b"[]"),
        lambda folder: (folder / "record.json").write_bytes(b"[" * 100_000),
        lambda folder: (folder / "record.json").write_bytes(b'{"colour": "red"}'),
        lambda folder: folder.rename(folder.with_name("other")),
    ],
)
def test_a_damaged_one_is_listed_as_such_and_never_fatal(store: CalibrationStore, damage: Any) -> None:
    for name in ("rig-7", "rig-8"):
        store.add(calibration(name))
        for path in (store.directory / name).iterdir():
            path.chmod(0o644)
    damage(store.directory / "rig-7")
    created = store.created()
    good, bad = sorted(map(store.entry, created), key=lambda entry: entry.problem is not None)
    assert (good.id, good.problem) == ("rig-8", None)
    assert bad.problem
    assert {name: at is None for name, at in created.items()} == {good.id: False, bad.id: True}
    with pytest.raises(StorageError):
        store.get(bad.id)
    with pytest.raises(StorageError):
        store.content(bad.id)


def test_a_value_that_somebody_changed_by_hand_is_found_out(store: CalibrationStore) -> None:
    store.add(calibration("rig-7"))
    path = store.directory / "rig-7" / "calibration.json"
    store.get("rig-7")
    path.chmod(0o644)
    path.write_bytes(path.read_bytes().replace(b'"f_mm": 8.0', b'"f_mm": 8.1'))
    os.utime(path, ns=(0, 0))
    with pytest.raises(StorageError, match="not what was stored"):
        store.get("rig-7")


def test_a_file_that_somebody_put_there_is_listed_as_no_calibration(store: CalibrationStore) -> None:
    (store.directory / "my rig.json").write_text("{}")
    [listed] = map(store.entry, store.created())
    assert (listed.id, listed.document) == ("my rig.json", {})
    assert listed.problem


@pytest.mark.parametrize("name", ["..", "../secret", "a/b", "", "a.b", "x" * 81, "ü", "a\n", ".part-1"])
def test_no_id_leads_out_of_the_folder(store: CalibrationStore, name: str) -> None:
    (store.directory.parent / "secret").mkdir()
    for look in (store.get, store.content, store.report, store.page):
        with pytest.raises(NotFound):
            look(name)
    with pytest.raises(InputError):
        store.add(calibration(name))


def test_what_is_no_calibration_is_not_stored(store: CalibrationStore) -> None:
    for document in ({}, {"schema": "x"}, calibration("one", details={"x": float("nan")})):
        with pytest.raises(InputError):
            store.add(document)
    with pytest.raises(InputError):
        store.add(calibration("one", source="half a \ud800"))
    assert files_of(store) == {}


def test_what_a_crash_left_unfinished_is_no_calibration_and_is_cleared_away(store: CalibrationStore) -> None:
    left = store.directory / ".part-abc" / "rig-7"
    left.mkdir(parents=True)
    (left / "calibration.json").write_text("{}")
    assert store.created() == {}
    store.open()
    assert list(store.directory.iterdir()) == []


def test_a_failed_write_leaves_nothing_behind(
    store: CalibrationStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StorageError, match="space"):
        store.add(calibration("rig-7"))
    monkeypatch.undo()
    assert store.created() == {}
    assert list(store.directory.iterdir()) == []
    store.add(calibration("rig-7"))


def test_a_folder_that_is_not_there_yet_holds_nothing(tmp_path: Path) -> None:
    assert CalibrationStore(tmp_path / "nowhere").created() == {}


@every_way
@pytest.mark.parametrize("name", ["calibration.json", "record.json", "report.json", "report.html"])
def test_what_is_damaged_before_it_is_read_back_is_not_stored(store, monkeypatch, spoil, name) -> None:
    damage(monkeypatch, spoil, name)
    with pytest.raises(StorageError, match=f"{name} reads back other than it was written"):
        store.add(calibration("rig-7"), report={"id": "rig-7"}, page="<!doctype html><p>σ: .12 px</p>" * 9)
    assert "rig-7" not in store
    assert list(store.directory.iterdir()) == []


def test_a_page_that_no_browser_closes_is_not_stored(store: CalibrationStore) -> None:
    with pytest.raises(StorageError, match=r"report.html .*<p> is not closed"):
        store.add(calibration("rig-7"), page="<!doctype html><p>")
    assert "rig-7" not in store
