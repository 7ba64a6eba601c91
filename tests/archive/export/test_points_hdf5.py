"""Points and channels as HDF5, opened by h5py without what wrote them."""

import json

import numpy as np
import pytest

from archive.captures import META, points, slots, write
from archive.readings import readings, write_with_channels
from grabberd.archive.export.hdf5_file import export_hdf5
from grabberd.archive.export.points_columns import POINT_COLUMNS
from grabberd.errors import StorageError

h5py = pytest.importorskip("h5py")
MEASURED = (0, 1, 4)


@pytest.fixture
def file(tmp_path):
    path = write_with_channels(tmp_path, slots(60), measured=MEASURED)
    assert export_hdf5(path, tmp_path / "out") == sum(len(points(n)) for n in MEASURED)
    with h5py.File(tmp_path / "out" / "points.h5") as opened:
        yield opened


def test_every_column_of_the_points_is_an_array(file):
    group = file["points"]
    assert list(group) == [column.name for column in POINT_COLUMNS]
    expected = np.concatenate([points(n).xyz_mm for n in MEASURED])
    np.testing.assert_allclose(np.column_stack([group[f"{axis}_mm"] for axis in "xyz"]), expected, atol=1e-4)
    assert sorted(set(group["n"][()].tolist())) == list(MEASURED)
    assert group["x_mm"].attrs["unit"] == "mm"
    assert group["utc" if "utc" in group else "time_utc"].asstr()[0].startswith("2026-")


def test_every_reading_of_the_channels_is_a_row(file):
    group = file["channels"]
    own = group["channel"].asstr()[()] == "pulsation"
    shown = readings(0, 240)
    np.testing.assert_array_equal(group["value"][own], shown.value)
    np.testing.assert_allclose(group["vacuum_kpa"][own], 101.3 - 0.1 * shown.value)
    np.testing.assert_allclose(group["time_s"][own], (shown.time_ns - shown.time_ns[0]) / 1e9)


def test_it_says_where_it_comes_from(file):
    assert json.loads(file.attrs["grabberd"])["capture"] == META.id


def test_a_capture_without_channels_has_no_such_group(tmp_path):
    export_hdf5(write(tmp_path, slots(5), measured=[1]), tmp_path / "out")
    with h5py.File(tmp_path / "out" / "points.h5") as opened:
        assert list(opened) == ["points"]
    assert (tmp_path / "out" / "ledger.csv").exists()


def test_a_folder_that_is_not_empty_is_refused(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").touch()
    with pytest.raises(StorageError):
        export_hdf5(write(tmp_path, slots(5), measured=[1]), tmp_path / "out")
