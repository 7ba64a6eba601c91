"""The catalog of calibrations: in which order they are listed, and what is read for a list."""

from pathlib import Path

import pytest
from calibrators import calibration

from grabberd.archive.calibrations import calibration_catalog
from grabberd.archive.calibrations.calibration_catalog import CalibrationCatalog
from grabberd.archive.state.calibration_store import StoredCalibration
from grabberd.documents.calibrations import CalibrationRow


def test_the_newest_comes_first_whatever_zone_its_time_is_given_in(tmp_path: Path) -> None:
    catalog = CalibrationCatalog(tmp_path, {})
    times = {
        "b": "2026-03-01T10:00:00Z",
        "a": "2026-03-01T09:00:00-02:00",
        "c": "2026-03-01T11:00:00+02:00",
        "d": "2026-03-01T08:30:00",
        "e": "0001-01-01T00:00:00+14:00",
    }
    for name, time in times.items():
        catalog.store.add(calibration(name, created_utc=time))
    assert [head.id for head in catalog.heads()] == ["a", "b", "c", "d", "e"]


def test_documents_are_not_kept_for_the_list(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    catalog, described = CalibrationCatalog(tmp_path, {}), list[str]()

    def row(entry: StoredCalibration) -> CalibrationRow:
        described.append(entry.id)
        return calibration_catalog._row(entry.id, entry.document)

    monkeypatch.setattr(calibration_catalog, "stored_row", row)
    for name in "abc":
        catalog.store.add(calibration(name))
    heads = catalog.heads()
    assert (len(heads), described) == (3, [])
    assert catalog.row(heads[0]).id == heads[0].id == described[0]
