"""Re-measuring an archive: a data set others read, nothing twice, nothing half, none left out unsaid."""

import hashlib
import json
import os
import re
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path
from textwrap import dedent
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
import reprocessing as made
from reprocessing import CALIBRATION, FIELDS, add_capture, archive, files, measured, only_finished, table

from archive.captures import regrouped
from grabberd import __version__
from grabberd.archive.capture.content_digest import document_sha256
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.runs import append_run
from grabberd.archive.export.dataset import DataSet
from grabberd.archive.export.points_columns import DATASET_COLUMNS
from grabberd.archive.measure_setups import measure_setup
from grabberd.core.chain.measure import measure_fields
from grabberd.errors import Conflict, InputError, StorageError
from grabberd.files.reading import read_documents
from grabberd_reprocess.reprocess_archive import ReprocessProgress, find_captures


@pytest.fixture(scope="module")
def captures(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return archive(tmp_path_factory.mktemp("captures"), 4)


@pytest.fixture(scope="module")
def out(captures: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("points")
    summary = measured(captures[0].parent, folder)
    assert (summary.measured, summary.fields, summary.refused) == (4, 4 * FIELDS, [])
    return folder


def about(path: Path) -> dict[str, object]:
    return json.loads(pq.read_metadata(path).metadata[b"grabberd"])


def digests(paths: list[Path]) -> list[str]:
    return [hashlib.sha256(path.read_bytes()).hexdigest() for path in paths]


def other_calibration(folder: Path, **changes: object) -> Path:
    document = json.loads(CALIBRATION.read_text()) | {"id": "a better one"} | changes
    file = folder / "other.json"
    file.write_text(json.dumps(document))
    return file


# ---- what is written


def test_points_are_those_that_measuring_the_fields_gives(captures: list[Path], out: Path) -> None:
    with CaptureReader(captures[0]) as reader:
        documents = read_documents(CALIBRATION, made.OBJECT)
        points = list(measure_fields(reader.received(), measure_setup(documents, {})))
    rows = table(out).to_pandas().query("capture == 'capture-0'").sort_values(["n", "target"])
    assert rows.n.tolist() == [one.n for one in points for _ in range(len(one.points))]
    np.testing.assert_array_equal(
        rows[["x_mm", "y_mm", "z_mm"]], np.concatenate([one.points.xyz_mm for one in points])
    )


def test_columns_are_those_of_exported_points_and_those_that_tell_captures_apart(out: Path) -> None:
    names = [column.name for column in DATASET_COLUMNS]
    assert names[-4:] == ["capture", "device", "calibration", "labels"]
    assert table(out).column_names == [*names, "barn", "day"]


def test_captures_lie_in_folders_by_barn_and_day(out: Path) -> None:
    folders = {str(path.parent.relative_to(out)) for path in files(out)}
    assert folders == {
        "barn=%C3%85s/day=2026-03-01",
        "barn=%C3%85s/day=2026-03-03",
        "barn=Stall%203%2FNord/day=2026-03-02",
        "barn=Stall%203%2FNord/day=2026-03-01",
    }
    assert all(path.name.startswith("capture-") for path in files(out))


def test_duckdb_reads_it_as_it_is(out: Path) -> None:
    import duckdb  # noqa: PLC0415

    query = (
        f"SELECT barn, day::VARCHAR, count(DISTINCT n), any_value(labels['cow']) "
        f"FROM read_parquet('{out}/*/*/*.parquet', hive_partitioning = true) GROUP BY ALL ORDER BY ALL"
    )
    assert duckdb.sql(query).fetchall() == [
        ("Stall 3/Nord", "2026-03-01", FIELDS, "1807"),
        ("Stall 3/Nord", "2026-03-02", FIELDS, "1807"),
        ("Ås", "2026-03-01", FIELDS, "1807"),
        ("Ås", "2026-03-03", FIELDS, "1807"),
    ]


def test_pandas_reads_it_as_it_is(out: Path) -> None:
    import pandas as pd  # noqa: PLC0415

    frame = pd.read_parquet(out)
    assert sorted(frame.barn.unique()) == ["Stall 3/Nord", "Ås"]
    assert str(frame.time_utc.dtype).endswith("UTC]")
    assert dict(frame.labels[0]) == {"cow": "1807", "teat": "front left"}


def test_the_lines_of_the_manual_read_captures_with_and_without_the_label(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import duckdb  # noqa: PLC0415

    (tmp_path / "captures").mkdir()
    for name, labels in (("labelled", {"cow": "1807"}), ("other", {"teat": "front"}), ("bare", {})):
        day = {"site": {"barn": "Ås"}, "created_utc": "2026-03-02T09:30:00.000Z"}
        add_capture(tmp_path / "captures", name, labels=labels, **day)
    measured(tmp_path / "captures", tmp_path / "points")
    monkeypatch.chdir(tmp_path)
    page = (made.MANUAL / "archive.md").read_text(encoding="utf-8")
    names: dict[str, Any] = {}
    for reader in ("pandas", "pyarrow"):
        lines = re.search(rf"^With {reader}, .*\n\n((?:(?:    .*)?\n)+)", page, re.MULTILINE)
        exec(dedent(lines[1]), names)
    cows = names["frame"].drop_duplicates("capture").set_index("capture").cow
    assert cows["labelled"] == "1807"
    assert cows[["other", "bare"]].isna().all()
    query = re.search(r"^With DuckDB:\n\n((?:    \w.*\n)+)", page, re.MULTILINE)
    assert {cow for _, _, cow, *_ in duckdb.sql(query[1]).fetchall()} == {"1807", None}


def test_a_fields_time_is_the_time_of_day(out: Path) -> None:
    times = table(out).to_pandas().query("capture == 'capture-0'").time_utc
    assert times.min().isoformat() == "2026-03-01T09:30:00+00:00"
    assert (times.max() - times.min()).total_seconds() == pytest.approx(0.02 * (FIELDS - 1), abs=0.002)


def test_every_file_says_what_it_comes_from(captures: list[Path], out: Path) -> None:
    said = about(next(path for path in files(out) if path.name.startswith("capture-0")))
    calibration = json.loads(CALIBRATION.read_text())
    assert said["calibration"] == {"id": calibration["id"], "sha256": document_sha256(calibration)}
    assert said["version"] == __version__
    assert said["capture"]["id"] == "capture-0"  # type: ignore[index]
    assert said["capture"]["bytes"] == captures[0].stat().st_size  # type: ignore[index]
    assert said["fields"] == FIELDS
    assert said["parameters"] == {}
    kept = json.loads((out / "_made_with" / f"{document_sha256(calibration)}.json").read_text())
    assert kept == calibration


def test_captures_are_not_changed(captures: list[Path], tmp_path: Path) -> None:
    before = digests(captures), [path.stat().st_mtime_ns for path in captures]
    measured(captures, tmp_path)
    assert (digests(captures), [path.stat().st_mtime_ns for path in captures]) == before


def test_an_id_that_readers_would_pass_over_is_written_so_that_they_do_not(tmp_path: Path) -> None:
    add_capture(tmp_path, "_hidden")
    measured(tmp_path, tmp_path / "out")
    assert table(tmp_path / "out")["capture"].unique().to_pylist() == ["_hidden"]


# ---- again


def test_what_is_done_is_not_done_again(captures: list[Path], tmp_path: Path) -> None:
    measured(captures[:2], tmp_path)
    before = [path.stat().st_mtime_ns for path in files(tmp_path)]
    again = measured(captures, tmp_path)
    assert (again.measured, again.unchanged) == (2, 2)
    assert [
        path.stat().st_mtime_ns for path in files(tmp_path) if path.stat().st_mtime_ns in before
    ] == before


def test_a_copy_and_a_run_that_was_added_do_not_change_a_capture(tmp_path: Path) -> None:
    path = add_capture(tmp_path, "one")
    measured(path, tmp_path / "out")
    append_run(path, "measure", "2026-04-01T00:00:00.000Z", __version__, {}, [])
    os.utime(path)
    again = measured(path, tmp_path / "out")
    assert (again.measured, again.unchanged) == (0, 1)


def test_a_capture_of_other_content_replaces_what_was_there(tmp_path: Path) -> None:
    begun = {"start_ns": 7, "created_utc": "2026-03-01T09:30:00.000Z"}
    path = add_capture(tmp_path, "one", **begun)
    measured(path, tmp_path / "out")
    path.unlink()
    add_capture(tmp_path, "one", labels={"cow": "7"}, **begun)
    assert measured(path, tmp_path / "out").measured == 1
    assert len(files(tmp_path / "out")) == 1
    assert {row["labels"][0] for row in table(tmp_path / "out").to_pylist()} == {("cow", "7")}


def test_a_damaged_file_of_the_data_set_is_made_again(captures: list[Path], tmp_path: Path) -> None:
    measured(captures[0], tmp_path)
    (file,) = files(tmp_path)
    file.write_bytes(file.read_bytes()[:1000])
    assert measured(captures[0], tmp_path).measured == 1
    assert table(tmp_path).num_rows > 0


def test_points_of_another_calibration_stay_until_they_are_to_be_replaced(
    captures: list[Path], tmp_path: Path
) -> None:
    out, other = tmp_path / "out", other_calibration(tmp_path)
    measured(captures[:2], out)
    before = digests(files(out))
    with pytest.raises(Conflict, match="2 of these captures") as caught:
        measured(captures, out, calibration=other)
    assert "--replace" in caught.value.hint
    assert digests(files(out)) == before
    assert measured(captures[:2], out, calibration=other, replace=True).measured == 2
    assert table(out)["calibration"].unique().to_pylist() == ["a better one"]
    assert len(files(out)) == 2


def test_captures_of_another_time_may_have_another_calibration(captures: list[Path], tmp_path: Path) -> None:
    measured(captures[0], tmp_path / "out")
    measured(captures[1], tmp_path / "out", calibration=other_calibration(tmp_path))
    assert len(table(tmp_path / "out")["calibration"].unique()) == 2


def test_an_interrupted_run_leaves_nothing_half_and_the_next_goes_on(
    captures: list[Path], tmp_path: Path
) -> None:
    def interrupt(far: ReprocessProgress) -> None:
        if far.left < len(captures):
            raise KeyboardInterrupt

    first = measured(captures, tmp_path, on_progress=interrupt)
    assert first.interrupted
    assert 1 <= first.measured < len(captures)
    assert only_finished(tmp_path)
    again = measured(captures, tmp_path)
    assert (again.measured + again.unchanged, again.interrupted) == (len(captures), False)
    assert len(table(tmp_path)["capture"].unique()) == len(captures)


def test_the_progress_ends_at_the_end(captures: list[Path], tmp_path: Path) -> None:
    seen: list[ReprocessProgress] = []
    measured(captures, tmp_path, on_progress=seen.append)
    assert seen[-1][:3] == (4 * FIELDS, 4 * FIELDS, 0)
    assert [one.left for one in seen] == sorted((one.left for one in seen), reverse=True)


def test_one_program_at_a_time_measures_into_a_data_set(captures: list[Path], tmp_path: Path) -> None:
    with DataSet(tmp_path), pytest.raises(StorageError, match="another grabberd is measuring"):
        measured(captures, tmp_path)


def test_what_a_killed_program_left_is_cleared_away(captures: list[Path], tmp_path: Path) -> None:
    (tmp_path / "_scratch" / "old").mkdir(parents=True)
    (tmp_path / "_scratch" / "old" / "0.part").touch()
    measured(captures[0], tmp_path)
    assert only_finished(tmp_path)


# ---- what cannot be measured


def test_one_bad_file_does_not_stop_the_others(captures: list[Path], tmp_path: Path) -> None:
    bad = tmp_path / "bad.grab"
    bad.write_bytes(captures[0].read_bytes()[:40_000])
    summary = measured([bad, *captures], tmp_path / "out")
    assert summary.measured == 4
    assert [refusal.capture for refusal in summary.refused] == [bad]
    assert summary.refused[0].hint


def test_a_field_that_the_disk_has_changed_is_left_out_and_told(tmp_path: Path) -> None:
    path = regrouped(add_capture(tmp_path, "one"), 1)
    with CaptureReader(path) as reader:
        fields = reader.field_count
    change(path, "UPDATE pictures SET data = x'0102' WHERE first_n = 4")
    summary = measured(path, tmp_path / "out")
    assert (summary.refused, summary.fields) == ([], fields - 1)
    assert ["field 4: it is not what was written" in one.reason for one in summary.warned] == [True]


def test_a_capture_whose_metadata_were_changed_leaves_nothing(tmp_path: Path) -> None:
    path = add_capture(tmp_path, "one")
    change(path, "UPDATE meta SET value = '25.0' WHERE key = 'rate_hz'")
    summary = measured(path, tmp_path / "out")
    assert ["its metadata" in one.problem for one in summary.refused] == [True]
    assert files(tmp_path / "out") == []
    assert only_finished(tmp_path / "out")


def change(path: Path, statement: str) -> None:
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute(statement)


def test_running_and_set_aside_captures_are_passed_over_and_named(
    captures: list[Path], tmp_path: Path
) -> None:
    made.copied(captures[0], tmp_path / "one.grab")
    made.copied(captures[1], tmp_path / "two.grab.part")
    made.copied(captures[2], tmp_path / "damaged" / "three.grab")
    summary = measured(tmp_path, tmp_path / "out")
    assert (summary.measured, summary.refused) == (1, [])
    assert {one.capture.name: one.reason.split(":")[0] for one in summary.left_out} == {
        "two.grab.part": "is not sealed",
        "three.grab": "was set aside as damaged",
    }


def test_a_capture_that_lies_there_twice_is_measured_once(captures: list[Path], tmp_path: Path) -> None:
    copy = made.copied(captures[0], tmp_path / "copy.grab")
    summary = measured([captures[0], copy], tmp_path / "out")
    assert (summary.measured, summary.refused) == (1, [])
    assert "the same capture" in summary.left_out[0].reason


def test_two_captures_of_one_id_are_not_mixed(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    one = add_capture(tmp_path / "a", "liner")
    two = add_capture(tmp_path / "b", "liner", created_utc="2026-03-02T09:30:00.000Z")
    together = measured([one, two], tmp_path / "out")
    assert (together.measured, [refusal.capture for refusal in together.refused]) == (1, [two])
    later = measured(two, tmp_path / "out")
    assert "is also called liner" in later.refused[0].problem


def test_a_capture_without_a_barn_is_refused_until_it_is_named(tmp_path: Path) -> None:
    path = add_capture(tmp_path, "one", site={})
    (refusal,) = measured(path, tmp_path / "out").refused
    assert "--barn" in refusal.hint
    assert measured(path, tmp_path / "out", barn="../north").measured == 1
    assert table(tmp_path / "out")["barn"].unique().to_pylist() == ["../north"]


def test_a_calibration_that_does_not_fit_is_said_of_each_capture(
    captures: list[Path], tmp_path: Path
) -> None:
    other = other_calibration(tmp_path, image={"columns": 768, "lines": 576})
    summary = measured(captures[:2], tmp_path / "out", calibration=other)
    assert [refusal.problem[:11] for refusal in summary.refused] == ["calibration"] * 2
    assert files(tmp_path / "out") == []


def test_a_rig_with_another_glass_is_refused(tmp_path: Path) -> None:
    glass = {"thickness_mm": 3.0, "refractive_index": 1.5}
    path = add_capture(tmp_path, "one", config={"rig": {"glass": glass}})
    assert "the rig is set up" in measured(path, tmp_path / "out").refused[0].problem


def test_without_an_object_model_the_captures_own_is_taken(captures: list[Path], tmp_path: Path) -> None:
    path = made.copied(captures[0], tmp_path / "own.grab")
    documents = read_documents(CALIBRATION, made.OBJECT) | {"settings": {}}
    append_run(path, "measure", "2026-04-01T00:00:00.000Z", __version__, documents, [])
    summary = measured([path, captures[1]], tmp_path / "out", object_model=None)
    assert summary.measured == 1
    assert "--object" in summary.refused[0].hint


def test_sources_without_captures_are_said_at_once(tmp_path: Path) -> None:
    for source, words in ((tmp_path, "no sealed captures"), (tmp_path / "*.grab", "there is no")):
        with pytest.raises(InputError, match=words):
            measured(source, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_patterns_go_down_into_folders(captures: list[Path], tmp_path: Path) -> None:
    home, below = captures[0].parent, tmp_path / "2026" / "march"
    below.mkdir(parents=True)
    copies = [Path(shutil.copy(one, below)) for one in captures[:2]]
    assert find_captures([f"{tmp_path}/**/{copies[0].stem[:-1]}[01].grab"]).captures == copies
    assert find_captures([str(home), f"{home}/*.grab", str(captures[0])]).captures == captures


def test_a_setting_that_is_none_is_refused_before_anything_is_written(
    captures: list[Path], tmp_path: Path
) -> None:
    with pytest.raises(InputError):
        measured(captures, tmp_path / "out", settings={"method": "guessing"})
    assert not (tmp_path / "out").exists()
