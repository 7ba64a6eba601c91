"""Points as C3D, opened by the libraries that motion analysis opens such files with."""

import warnings

import numpy as np
import pytest

from archive.captures import MADE_WITH, META, points, slot, slots, write
from archive.milkings import object_document
from archive.readings import readings, write_with_channels
from grabberd.archive.export.c3d_file import (
    MOST_FRAMES,
    Markers,
    c3d_frames,
    c3d_head,
    c3d_padding,
    export_c3d,
    points_c3d,
)
from grabberd.core.ledger import Outcome
from grabberd.errors import InputError, NotFound, StorageError

LOST = 3
"""Fields that are lost after the third."""


def content(path, run=None):
    return b"".join(points_c3d(path, run))


def by_ezc3d(data, tmp_path):
    """A file as ezc3d reads it: (T, F, 3) positions, NaN where there is none, and the parameters."""
    ezc3d = pytest.importorskip("ezc3d")
    (tmp_path / "read.c3d").write_bytes(data)
    read = ezc3d.c3d(str(tmp_path / "read.c3d"))
    return read["data"]["points"][:3].transpose(2, 1, 0), read["parameters"]


def by_c3d(data, tmp_path):
    """A file as py-c3d reads it: the reader, and (F, T, 5) positions, residuals and masks of cameras."""
    c3d = pytest.importorskip("c3d")
    (tmp_path / "read.c3d").write_bytes(data)
    with (tmp_path / "read.c3d").open("rb") as file, warnings.catch_warnings():
        warnings.filterwarnings("ignore", "No analog data found in file.")
        reader = c3d.Reader(file)
        frames = np.array([one for _, one, _ in reader.read_frames()])
    return reader, frames


def by_standard(data):
    """(F, T, 4) words of a file, by what the standard says of its head."""
    markers, first_block = (int.from_bytes(data[at : at + 2], "little") for at in (2, 16))
    words = np.frombuffer(data, "<f4", offset=(first_block - 1) * 512)
    return words[: len(words) // (4 * markers) * 4 * markers].reshape(-1, markers, 4)


def values(parameter):
    return parameter["value"]


@pytest.fixture
def measured(tmp_path):
    """Fields 0, 1, 2, then three that are lost, then 6 to 9, of which 8 was not measured."""
    taken = [*slots(3), slot(3 + LOST, lost=LOST), *(slot(n) for n in range(4 + LOST, 10))]
    return write(tmp_path, taken, measured=[0, 1, 2, 6, 7, 9])


def seen(*fields):
    return sorted({int(target) for n in fields for target in points(n).target})


# --- markers and frames ---


def test_ezc3d_finds_every_point_at_its_place(measured, tmp_path):
    found, parameters = by_ezc3d(content(measured), tmp_path)
    targets = seen(0, 1, 2, 6, 7, 9)
    assert [label.strip() for label in values(parameters["POINT"]["LABELS"])] == [
        f"T{one:03d}" for one in targets
    ]
    for n in (0, 1, 2, 6, 7, 9):
        expected = np.full((len(targets), 3), np.nan)
        expected[np.searchsorted(targets, points(n).target)] = points(n).xyz_mm
        np.testing.assert_allclose(found[n], expected, atol=1e-5)


def test_py_c3d_finds_the_same(measured, tmp_path):
    reader, frames = by_c3d(content(measured), tmp_path)
    targets = seen(0, 1, 2, 6, 7, 9)
    assert [label.strip() for label in reader.point_labels] == [f"T{one:03d}" for one in targets]
    assert (reader.point_rate, reader.frame_count, reader.get("POINT:UNITS").string_value) == (50.0, 10, "mm")
    places = np.searchsorted(targets, points(7).target)
    np.testing.assert_allclose(frames[7, places, :3], points(7).xyz_mm, atol=1e-5)
    assert set(frames[7, places, 4]) == {3.0}, "both cameras"


def test_lost_fields_are_frames_without_a_valid_marker(measured, tmp_path):
    words = by_standard(content(measured))[:10]
    assert (words[3 : 3 + LOST, :, 3] == -1).all()
    assert (words[8, :, 3] == -1).all(), "a field that was not measured"
    assert (words[words[:, :, 3] == -1][:, :3] == 0).all()
    found, _ = by_ezc3d(content(measured), tmp_path)
    assert np.isnan(found[[3, 4, 5, 8]]).all()


def test_the_residual_is_the_sigma_of_the_position(measured, tmp_path):
    data = content(measured)
    reader, _ = by_c3d(data, tmp_path)
    scale_mm = abs(reader.point_scale)
    words = by_standard(data)[7, np.searchsorted(seen(0, 1, 2, 6, 7, 9), points(7).target), 3].astype(int)
    sigma_mm = np.sqrt(np.trace(points(7).covariance_mm2, axis1=1, axis2=2))
    np.testing.assert_allclose((words & 0xFF) * scale_mm, sigma_mm, atol=scale_mm)
    assert (words & 0xFF).min() > 0, "0 would be an interpolated point"
    assert set(words >> 8) == {3}


def test_coordinates_fit_into_the_integers_of_a_program_that_converts_them(measured, tmp_path):
    reader, frames = by_c3d(content(measured), tmp_path)
    assert np.abs(frames[:, :, :3]).max() / abs(reader.point_scale) < 2**15


def test_time_is_told_by_rate_and_first_frame(measured, tmp_path):
    _, parameters = by_ezc3d(content(measured), tmp_path)
    assert values(parameters["POINT"]["RATE"])[0] == 50.0
    assert values(parameters["TRIAL"]["CAMERA_RATE"])[0] == 50.0
    assert list(values(parameters["TRIAL"]["ACTUAL_START_FIELD"])) == [1, 0]
    assert list(values(parameters["TRIAL"]["ACTUAL_END_FIELD"])) == [10, 0]


def test_the_file_says_which_capture_run_and_calibration_it_is_of(measured, tmp_path):
    _, parameters = by_ezc3d(content(measured), tmp_path)
    expected = {"CAPTURE": META.id, "CREATED_UTC": META.created_utc, "RUN": "1", "CALIBRATION": "rig-7"}
    assert {name: values(parameters["GRABBERD"][name])[0] for name in expected} == expected


# --- labels ---


def test_labels_have_row_and_column_where_the_object_model_has_them(tmp_path):
    model = object_document()
    path = write(tmp_path, slots(2), measured=[0], made_with={**MADE_WITH, "object": model})
    _, parameters = by_ezc3d(content(path), tmp_path)
    labels = [label.strip() for label in values(parameters["POINT"]["LABELS"])]
    for one in model["targets"]:
        assert f"T{one['id']:03d}_R{one['row']:02d}_C{one['column']:02d}" in labels
    assert all(4 <= len(label) <= 32 for label in labels)
    assert len(labels) == len(set(labels)) == len({*seen(0), *(one["id"] for one in model["targets"])})


def written(targets, frames, tmp_path):
    labels = [f"T{one:05d}" for one in range(targets)]
    markers = Markers(labels, labels, frames, 50.0, 0.001, {})
    xyz_mm = np.arange(frames * targets * 3, dtype=float).reshape(frames, targets, 3) / 1000
    block = c3d_frames(xyz_mm, np.full((frames, targets), 0.05), 0.001)
    data = c3d_head(markers) + block.tobytes() + c3d_padding(markers)
    return data, labels, xyz_mm


def test_more_labels_than_one_parameter_holds_go_into_further_ones(tmp_path):
    data, labels, xyz_mm = written(600, 2, tmp_path)
    found, parameters = by_ezc3d(data, tmp_path)
    said = [values(parameters["POINT"][name]) for name in ("LABELS", "LABELS2", "LABELS3")]
    assert [one for some in said for one in some] == labels
    assert [len(some) for some in said] == [255, 255, 90]
    np.testing.assert_allclose(found, xyz_mm, rtol=1e-6)


def test_more_frames_than_the_head_counts_are_counted_in_parameters(tmp_path):
    data, _, xyz_mm = written(1, 70_000, tmp_path)
    found, parameters = by_ezc3d(data, tmp_path)
    # It reads on to the end of the last block.
    np.testing.assert_allclose(found[:70_000], xyz_mm, rtol=1e-6)
    assert values(parameters["POINT"]["LONG_FRAMES"])[0] == 70_000
    reader, frames = by_c3d(data, tmp_path)
    assert reader.frame_count == len(frames) == 70_000


@pytest.mark.parametrize(("targets", "frames"), [(1, MOST_FRAMES + 1), (70_000, 1), (20_000, 1)])
def test_what_the_format_has_no_room_for_is_refused(targets, frames):
    labels = [f"T{one}" for one in range(targets)]
    with pytest.raises(InputError, match="C3D has") as refused:
        c3d_head(Markers(labels, labels, frames, 50.0, 0.001, {}))
    assert "csv" in refused.value.hint


def test_a_long_gap_is_made_of_empty_frames(tmp_path):
    path = write(tmp_path, [slot(0), slot(5_000, lost=4_999)], measured=[0, 5_000])
    parts = list(points_c3d(path))
    words = by_standard(b"".join(parts))[:5001]
    assert (words[1:5000, :, 3] == -1).all()
    assert (words[5000, :, 3] > 0).sum() == 5
    assert max(map(len, parts)) < 200_000


def test_a_gap_of_years_is_refused(tmp_path):
    path = write(tmp_path, [slot(0), slot(MOST_FRAMES, lost=MOST_FRAMES - 1)], measured=[0, MOST_FRAMES])
    with pytest.raises(InputError, match=f"{MOST_FRAMES + 1} frames"):
        points_c3d(path)


def test_of_a_capture_that_is_being_recorded_there_is_what_is_measured(writer, part, tmp_path):
    writer.append(slots(5))
    for n in (0, 1, 2):
        writer.append_points(1, n, points(n))
    writer.commit()
    parts = points_c3d(part)
    head = next(parts)
    for n in (3, 4):
        writer.append_points(1, n, points(n))
    writer.commit()
    found, _ = by_ezc3d(head + b"".join(parts), tmp_path)
    assert len(found) == 3
    assert (~np.isnan(found)).all(axis=2).sum(axis=1).tolist() == [5, 5, 5]


# --- files ---


def test_a_file_is_written_beside_the_ledger(measured, tmp_path):
    assert export_c3d(measured, tmp_path / "out") == 30
    assert {one.name for one in (tmp_path / "out").iterdir()} == {"points.c3d", "ledger.csv"}
    assert (tmp_path / "out" / "points.c3d").read_bytes() == content(measured)
    with pytest.raises(StorageError, match="not empty"):
        export_c3d(measured, tmp_path / "out")


def test_without_a_point_there_is_no_marker_and_no_file(tmp_path):
    taken = [slot(0), slot(1, outcome=Outcome.DAMAGED, reason="stale rows")]
    path = write(tmp_path, taken, measured=[5])
    with pytest.raises(NotFound, match="no points"):
        points_c3d(path)
    with pytest.raises(NotFound):
        export_c3d(path, tmp_path / "out", run=2)
    assert not (tmp_path / "out").exists()


# --- channels ---


@pytest.fixture
def with_channels(tmp_path):
    """Ten fields, two of which are lost, with two channels of 200 readings a second."""
    taken = [*slots(3), *(slot(n, lost=2 if n == 5 else 0) for n in range(5, 10))]
    return write_with_channels(tmp_path, taken, measured=[0, 1, 2, 5, 6])


def expected_kpa(channel):
    value = readings(0, 40, channel=channel).value
    return 101.3 - 0.1 * value if channel == 0 else value


def test_channels_are_analog_at_a_multiple_of_the_rate_of_the_frames(with_channels, tmp_path):
    ezc3d = pytest.importorskip("ezc3d")
    (tmp_path / "read.c3d").write_bytes(content(with_channels))
    read = ezc3d.c3d(str(tmp_path / "read.c3d"))
    parameters = read["parameters"]["ANALOG"]
    assert values(parameters["LABELS"]) == ["pulsation", "liner"]
    assert values(parameters["UNITS"]) == ["kPa", "kPa"]
    assert values(parameters["RATE"])[0] == 200.0
    analogs = read["data"]["analogs"][0]
    assert analogs.shape == (2, 40)
    for channel in (0, 1):
        np.testing.assert_allclose(analogs[channel, :32], expected_kpa(channel)[:32], rtol=1e-6)
    assert np.isnan(analogs[:, 32:]).all()
    assert read["data"]["points"].shape[2] == 10


def test_another_library_reads_the_same_channels_and_points(with_channels, tmp_path):
    c3d = pytest.importorskip("c3d")
    (tmp_path / "read.c3d").write_bytes(content(with_channels))
    with (tmp_path / "read.c3d").open("rb") as file:
        reader = c3d.Reader(file)
        frames = list(reader.read_frames())
    assert reader.analog_per_frame == 4
    analog = np.concatenate([one for _, _, one in frames], axis=1)
    np.testing.assert_allclose(analog[0, :12], expected_kpa(0)[:12], rtol=1e-6)
    assert [(one[:, 3] >= 0).any() for _, one, _ in frames] == [n in (0, 1, 2, 5, 6) for n in range(10)]


def test_a_file_with_channels_is_read_back_with_them(with_channels, tmp_path):
    assert export_c3d(with_channels, tmp_path / "out") == sum(len(points(n)) for n in (0, 1, 2, 5, 6))


@pytest.mark.parametrize("frames", [65_534, 65_535, 65_536, 70_000])
def test_of_many_frames_ezc3d_finds_no_point_beyond_the_last(frames, tmp_path):
    markers = Markers(["a", "b", "c", "d", "e"], [""] * 5, frames, 50.0, 0.01, {"x": "y"})
    words = c3d_frames(np.ones((frames, 5, 3)), np.full((frames, 5), 0.02), 0.01)
    found, _ = by_ezc3d(c3d_head(markers) + words.tobytes() + c3d_padding(markers), tmp_path)
    assert np.isfinite(found[:frames]).all()
    assert np.isnan(found[frames:]).all()
