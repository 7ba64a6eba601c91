"""A capture as a Python program has it: fields, points, ledger, runs, exports."""

import shutil
from pathlib import Path

import numpy as np
import pytest

import grabberd
from grabberd.archive.capture.meta import CaptureMeta
from grabberd.core.chain.accuracy import InvestigationSettings
from grabberd.errors import CaptureFileError, InputError, NotFound, NotReady
from grabberd.library import capture as module

LINER = grabberd.example("liner.grab")
OBJECT = grabberd.example("object.grab")


@pytest.fixture
def liner() -> grabberd.Capture:
    return grabberd.open(LINER)


@pytest.fixture
def copy(tmp_path: Path) -> grabberd.Capture:
    return grabberd.open(shutil.copy(OBJECT, tmp_path / "object.grab"))


def test_a_capture_tells_what_it_is(liner: grabberd.Capture) -> None:
    assert repr(liner) == "<Capture liner: 128 fields at 50 Hz, complete>"
    assert liner.labels == {"liner": "example-reference", "cow": "example-112"}
    assert liner.ledger.complete
    assert [run.run for run in liner.runs] == [1]
    assert liner.calibration is not None


def test_fields_are_pictures_with_their_times(liner: grabberd.Capture) -> None:
    field = liner.fields[40]
    assert (field.n, field.outcome, field.picture.shape) == (40, "received", (576, 720))
    assert field.time_s == pytest.approx(0.8, abs=0.002)
    assert set(np.unique(field.picture)) == {0, 255}
    assert field.lines.tolist() == list(range(576))


def test_fields_are_sliced_by_their_numbers(liner: grabberd.Capture) -> None:
    some = liner.fields[40:44]
    assert ([one.n for one in some], len(some), len(liner.fields[120:])) == ([40, 41, 42, 43], 4, 8)
    assert [one.n for one in some[42:60]] == [42, 43]
    with pytest.raises(ValueError, match="by their numbers"):
        liner.fields[::2]
    with pytest.raises(NotFound, match="no field 128"):
        liner.fields[128]


def test_points_have_units_sigma_and_their_origin(liner: grabberd.Capture) -> None:
    points = liner.points()
    assert (points.units["x_mm"], points.units["residual_px"], points.units["n"]) == ("mm", "px", "")
    assert len(points) == len(points["x_mm"]) == len(np.asarray(points))
    assert 0 < np.median(points["sigma_z_mm"]) < 0.2
    assert (points.about["capture"], points.about["run"]) == ("liner", 1)
    with pytest.raises(InputError, match="no column 'X'") as caught:
        points["X"]
    assert "x_mm" in caught.value.hint


def test_points_of_some_fields_are_those_of_all(liner: grabberd.Capture) -> None:
    every, some = liner.points(), liner.points(first_n=40, end_n=60, every=2)
    assert set(some["n"]) == set(range(40, 60, 2))
    assert np.array_equal(some.array, every.array[np.isin(every["n"], range(40, 60, 2))])
    with pytest.raises(NotFound, match="no points"):
        liner.points(first_n=1000)
    with pytest.raises(InputError, match="every is 0"):
        liner.points(every=0)


def test_a_data_frame_has_the_columns_and_their_units(liner: grabberd.Capture) -> None:
    pandas = pytest.importorskip("pandas")
    frame = liner.points(end_n=10).to_dataframe()
    assert isinstance(frame, pandas.DataFrame)
    assert frame.attrs["units"]["sigma_x_mm"] == "mm"
    assert frame.groupby("n").size().max() <= 108


def test_an_array_over_fields_and_targets_has_gaps_where_nothing_was_found(liner: grabberd.Capture) -> None:
    pytest.importorskip("xarray")
    points = liner.points()
    data = points.to_xarray()
    assert data.x_mm.dims == ("n", "target")
    assert (data.x_mm.attrs["units"], data.sizes["n"]) == ("mm", 128)
    assert int(data.x_mm.notnull().sum()) == len(points)
    one = points.array[500]
    assert float(data.z_mm.sel(n=one["n"], target=one["target"])) == one["z_mm"]
    assert float(data.time_s.sel(n=one["n"])) == one["time_s"]


def test_measuring_adds_a_run(copy: grabberd.Capture) -> None:
    assert copy.calibration is not None
    measured = copy.measure(copy.calibration)
    assert (measured.run, measured.fields, measured.verdict) == (2, 32, "measured_well")
    first, second = copy.points(1), copy.points()
    assert second.about["run"] == 2
    assert np.array_equal(first["target"], second["target"])
    off = np.abs(first["x_mm"] - second["x_mm"]) / first["sigma_x_mm"]
    assert np.quantile(off, 0.99) < 1, "measured by an earlier version, it differs within σ"
    copy.measure(copy.calibration)
    assert np.array_equal(second["x_mm"], copy.points()["x_mm"])


def test_a_method_that_there_is_not_is_refused_and_no_run_added(copy: grabberd.Capture) -> None:
    assert copy.calibration is not None
    with pytest.raises(InputError, match="method"):
        copy.measure(copy.calibration, method="guess")
    assert len(copy.runs) == 1


def test_measuring_without_an_object_is_refused(tmp_path: Path) -> None:
    frame = grabberd.open(shutil.copy(grabberd.example("frame.grab"), tmp_path / "frame.grab"))
    known = grabberd.open(LINER).calibration
    assert known is not None
    with pytest.raises(NotReady, match="no object model"):
        frame.measure(known)


def test_points_are_judged_by_the_truth() -> None:
    found = grabberd.open(OBJECT).accuracy(grabberd.example("object-truth.csv"))
    assert found.single.accuracy.missing == found.single.accuracy.wrong == 0
    assert found.single.accuracy.rmse.xyz_mm < 0.1


def test_whole_pictures_are_not_judged_as_fields(monkeypatch: pytest.MonkeyPatch) -> None:
    judged: list[InvestigationSettings] = []
    monkeypatch.setattr(CaptureMeta, "is_interlaced", False)
    monkeypatch.setattr(module, "investigate", lambda points, truth, settings: judged.append(settings))
    grabberd.open(OBJECT).accuracy(grabberd.example("object-truth.csv"))
    assert [one.interlaced for one in judged] == [False]


@pytest.mark.parametrize("file_format", ["csv", "mat", "png"])
def test_a_capture_is_exported(file_format: str, tmp_path: Path) -> None:
    out = grabberd.open(OBJECT).export(file_format, tmp_path / "out")
    assert list(out.glob(f"*.{file_format}"))


def test_an_unknown_format_is_refused(liner: grabberd.Capture, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="written as xls") as caught:
        liner.export("xls", tmp_path / "out")
    assert "csv" in caught.value.hint


def test_no_capture_is_no_capture(tmp_path: Path) -> None:
    (tmp_path / "text.grab").write_text("not a capture")
    with pytest.raises(CaptureFileError):
        grabberd.open(tmp_path / "text.grab")


def test_pictures_are_drawn_into_given_axes(liner: grabberd.Capture) -> None:
    figure = pytest.importorskip("matplotlib.figure").Figure()
    axes = figure.subplots(3)
    assert liner.plot_field(0, axes[0]).get_title() == "field 0, 0.00 s"
    assert liner.plot_points(0, ax=axes[1]).get_title() == "points of field 0"
    drawn = liner.plot_target(51, "x", ax=axes[2])
    assert drawn.get_ylabel() == "x, mm"
    with pytest.raises(InputError, match="no column 'w_mm'"):
        liner.plot_target(51, "w", ax=axes[2])
    with pytest.raises(NotFound, match="target 999 was found in no field"):
        liner.plot_target(999, ax=axes[2])


def test_an_unknown_example_is_refused() -> None:
    with pytest.raises(NotFound, match="no example") as caught:
        grabberd.example("cow.grab")
    assert "liner.grab" in caught.value.hint
