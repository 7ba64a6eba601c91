"""The commands as a person types them."""

import io
import json
import os
import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple

import pytest
from typer.testing import CliRunner, Result

from archive.captures import regrouped
from grabberd.archive.capture.reader import CaptureReader
from grabberd.cli import main
from grabberd.cli.app import app
from grabberd.config import shipped_configs
from grabberd.errors import CaptureFileError
from grabberd.files.disk import DirectoryLock

FAST = """
devices:
  simulated:
    driver: fake
    options: {{scene: liner, pace: free}}
    calibration: {configs}/fake.calibration.json
    object: {configs}/objects/liner.yaml
"""


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("config") / "fast.yaml"
    file.write_text(FAST.format(configs=shipped_configs()))
    return file


@pytest.fixture(scope="module")
def capture(config: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("capture") / "liner.grab"
    result = run("capture", "--config", config, "--fields", 30, "--out", out, "--label", "cow=112")
    assert result.exit_code == 0, result.output
    return out


def run(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


def shell(*words: object) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-c", "from grabberd.cli import main; main()", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


class Ended(NamedTuple):
    """A command that has ended, as its shell sees it."""

    returncode: int
    stderr: str


def typed(*words: object) -> Ended:
    """The same command with its exit code and complaints, in this process."""
    complaints = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(io.StringIO()), redirect_stderr(complaints):
        patch.setattr(sys, "argv", ["grabberd", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            main()
    assert isinstance(ended.value.code, int)
    return Ended(ended.value.code, complaints.getvalue())


def test_a_capture_is_written_and_its_verdict_printed(capture: Path, config: Path, tmp_path: Path) -> None:
    result = run("capture", "--config", config, "--fields", 5, "--out", tmp_path / "five.grab")
    assert "five.grab: 5 fields, complete\nmeasured " in result.output
    with CaptureReader(capture) as reader:
        assert reader.meta.labels == {"cow": "112"}
        assert reader.meta.id == "liner"
        assert reader.ledger.complete


def test_json_is_for_scripts(config: Path, tmp_path: Path) -> None:
    result = run("capture", "--config", config, "--fields", 5, "--out", tmp_path / "five.grab", "--json")
    assert json.loads(result.stdout)["ledger"]["complete"] is True


def test_nothing_is_left_beside_the_capture(config: Path, tmp_path: Path) -> None:
    run("capture", "--config", config, "--fields", 5, "--out", tmp_path / "five.grab")
    assert [path.name for path in tmp_path.iterdir()] == ["five.grab"]


def test_a_folder_that_is_not_there_and_an_address_that_is_none_are_said_plainly(tmp_path: Path) -> None:
    for words in (
        ("capture", "--fields", 5, "--out", tmp_path / "no" / "a.grab"),
        ("status", "--url", "foo"),
    ):
        result = shell(*words)
        assert result.returncode == 1
        assert "hint:" in result.stderr
        assert "Traceback" not in result.stderr


def test_an_existing_file_is_not_overwritten(capture: Path) -> None:
    result = typed("capture", "--fields", 5, "--out", capture)
    assert result.returncode == 1
    assert "exists already" in result.stderr
    assert "hint:" in result.stderr


@pytest.mark.parametrize(
    "words",
    [
        ("--bits", "7"),
        ("--lines", "tripled"),
        ("--label", "cow"),
        ("--fields", "5", "--duration-s", "1"),
        ("--fields", "0"),
    ],
)
def test_what_cannot_be_meant_is_refused_before_anything_starts(
    tmp_path: Path, words: tuple[str, ...]
) -> None:
    result = run("capture", "--out", tmp_path / "a.grab", *words)
    assert result.exit_code == 2
    assert not (tmp_path / "a.grab").exists()


def test_a_configuration_with_problems_names_them_all_and_exits_with_78(tmp_path: Path) -> None:
    file = tmp_path / "bad.yaml"
    file.write_text("devices: {one: {driver: fake, rig: {distance: 3}, calibration: no.json}}\nport: 1\n")
    for command in (("check-config", file), ("capture", "--config", file, "--out", tmp_path / "a.grab")):
        result = typed(*command)
        assert result.returncode == 78
        for key in ("devices.one.rig.distance", "devices.one.calibration", "port"):
            assert key in result.stderr


def test_a_daemon_that_cannot_write_its_disk_says_so_and_exits_with_74(tmp_path: Path) -> None:
    (tmp_path / "captures").write_text("where a folder should be")
    file = tmp_path / "fake.yaml"
    file.write_text(f"devices: {{one: {{driver: fake}}}}\nstorage: {{directory: {tmp_path}}}\n")
    result = shell("serve", "--port", 0, "--config", file)
    assert result.returncode == 74
    assert "hint: make room or fix the disk" in result.stderr


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("driver: nothing", "there is no driver 'nothing'"),
        ("driver: fake, options: {scene: moon}", "scene"),
        ("driver: fake, options: {speed: 3}", "speed"),
        ("driver: fake, calibration: bad.json, object: bad.json", "schema"),
        ("driver: fake, calibration: list.json, object: bad.json", "has no keys"),
        ("driver: fake, object: bad.json", "devices.one.object: the object file"),
    ],
)
def test_drivers_options_and_calibrations_are_checked_too(tmp_path: Path, line: str, says: str) -> None:
    (tmp_path / "bad.json").write_text("{}")
    (tmp_path / "list.json").write_text("[1, 2]")
    file = tmp_path / "bad.yaml"
    file.write_text(f"devices: {{one: {{{line}}}}}")
    result = typed("check-config", file)
    assert result.returncode == 78
    assert says in result.stderr


def test_problems_of_devices_loggers_and_mqtt_are_named_together(tmp_path):
    file = tmp_path / "grabberd.yaml"
    file.write_text(
        "devices: {one: {driver: nonsuch}}\n"
        "loggers: {vacuum: {driver: nonsuch, channels: {liner: {column: p1, sigma_kpa: 0.3}}}}\n"
        "mqtt: {host: broker}\n"
    )
    problems = {problem.key for problem in run("check-config", file).exception.problems}
    assert {"devices.one.driver", "loggers.vacuum.driver"} <= problems
    assert any(key.startswith(("mqtt", "site")) for key in problems)


def test_a_wrong_key_hides_neither_an_unknown_driver_nor_a_wrong_option(tmp_path):
    file = tmp_path / "grabberd.yaml"
    file.write_text(
        "devices:\n"
        "  one: {driver: nonsuch, focal: 3}\n"
        "  two: {driver: fake, options: {speed: 3, scene: moon}, rig: {distance: 240}}\n"
        "  three: {driver: replay, options: {pth: fields, rate: 3}}\n"
        "loggers: {vacuum: {driver: serial, options: {baud: 3}, chanels: {}}}\n"
    )
    problems = [(one.key, one.message) for one in run("check-config", file).exception.problems]
    assert {key for key, _ in problems} == {
        "devices.one.focal",
        "devices.one.driver",
        "devices.two.rig.distance",
        "devices.two.options",
        "devices.three.options",
        "loggers.vacuum.channels",
        "loggers.vacuum.chanels",
        "loggers.vacuum.options",
    }
    options = {message.partition(":")[0] for key, message in problems if key.endswith(".options")}
    assert options >= {"speed", "scene", "pth", "rate", "path", "baud"}


def test_the_shipped_configuration_is_good() -> None:
    result = run("check-config", shipped_configs() / "fake.yaml")
    assert result.exit_code == 0
    assert "valid" in result.output


def test_measuring_adds_a_run(capture: Path) -> None:
    configs = shipped_configs()
    words = (
        "--calibration",
        configs / "fake.calibration.json",
        "--object",
        configs / "objects" / "liner.yaml",
    )
    result = run("measure", capture, *words, "--json")
    document = json.loads(result.stdout)
    assert document["run"] >= 2
    coverage = document["coverage"]
    assert coverage["fields"] == document["fields"]
    assert sum(target["found"] for target in coverage["targets"]) == document["points"]


def test_measuring_leaves_out_what_the_disk_has_changed_and_says_so(capture: Path, tmp_path: Path) -> None:
    changed = regrouped(Path(shutil.copy(capture, tmp_path)), 3)
    with closing(sqlite3.connect(changed)) as connection, connection:
        connection.execute("UPDATE fields SET threshold = threshold + 1 WHERE n = 7")
    configs = shipped_configs()
    words = ("--calibration", configs / "fake.calibration.json", "--object", configs / "objects/liner.yaml")
    result = run("measure", changed, *words, "--json")
    assert json.loads(result.stdout)["fields"] == 27
    assert "note: " in result.stderr
    assert "field 7: it is not what was written" in result.stderr
    with closing(sqlite3.connect(changed)) as connection, connection:
        connection.execute("UPDATE meta SET value = '25.0' WHERE key = 'rate_hz'")
    with pytest.raises(CaptureFileError, match="its metadata: it is not what was written"):
        raise run("measure", changed, *words).exception or AssertionError("it was measured")


def test_measuring_says_in_words_how_well(capture: Path) -> None:
    configs = shipped_configs()
    words = ("--calibration", configs / "fake.calibration.json", "--object", configs / "objects/liner.yaml")
    lines = run("measure", capture, *words).output.splitlines()
    said = next(i for i, line in enumerate(lines) if "points in" in line)
    assert lines[said + 1].split(": ")[0] in {"measured well", "measured with gaps", "not measured"}


def test_accuracy_is_printed_against_the_simulators_truth(capture: Path, tmp_path: Path) -> None:
    truth = subprocess.run(
        [sys.executable, "-m", "grabberd_fake", "truth", str(capture)],
        capture_output=True,
        text=True,
        check=True,
    )
    file = tmp_path / "truth.csv"
    file.write_text(truth.stdout)
    result = run("accuracy", capture, "--truth", file, "--json")
    document = json.loads(result.stdout)
    assert document["wrong"] == 0
    assert document["matched"] > 60 * 30
    assert 0.01 < document["rmse"]["xyz_mm"] < 0.12


@pytest.mark.parametrize("text", ["", "target,x_mm\n1,2\n", "target,x_mm,y_mm,z_mm\n1,2,three,4\n"])
def test_a_truth_that_cannot_be_read_is_refused(capture: Path, tmp_path: Path, text: str) -> None:
    file = tmp_path / "truth.csv"
    file.write_text(text)
    result = typed("accuracy", capture, "--truth", file)
    assert result.returncode == 1
    assert "truth.csv" in result.stderr


def test_points_and_pictures_are_exported_into_an_empty_folder(capture: Path, tmp_path: Path) -> None:
    assert run("export", capture, "--out", tmp_path / "csv").exit_code == 0
    assert (tmp_path / "csv" / "points.csv").stat().st_size > 100_000
    assert run("export", capture, "--format", "png", "--out", tmp_path / "png").exit_code == 0
    assert len(list((tmp_path / "png").glob("*.png"))) == 30
    again = typed("export", capture, "--out", tmp_path / "csv")
    assert again.returncode == 1
    assert "not empty" in again.stderr


def test_a_recording_takes_a_grabbers_place(config: Path, capture: Path, tmp_path: Path) -> None:
    out = tmp_path / "again.grab"
    words = (
        "--config",
        config,
        "--device",
        f"replay:{capture}",
        "--bits",
        1,
        "--lines",
        "doubled",
        "--out",
        out,
    )
    result = run("capture", *words)
    assert result.exit_code == 0, result.output
    with CaptureReader(out) as reader:
        assert reader.ledger.received == 30


def test_a_picture_that_cannot_be_read_ends_the_capture_and_keeps_the_rest(
    config: Path, capture: Path, tmp_path: Path
) -> None:
    run("export", capture, "--format", "png", "--out", tmp_path / "png")
    broken = sorted((tmp_path / "png").glob("*.png"))[20]
    broken.write_bytes(broken.read_bytes()[:100])
    out = tmp_path / "again.grab"
    result = run("capture", "--config", config, "--device", f"replay:{tmp_path / 'png'}", "--out", out)
    assert broken.name in str(result.exception)
    with CaptureReader(out) as reader:
        assert reader.ledger.received == 20
        assert broken.name in (reader.meta.ended_because or "")
        assert reader.meta.complete is False


def test_a_capture_that_is_to_end_with_an_interruption_is_kept_and_says_so(tmp_path: Path) -> None:
    file = tmp_path / "away.yaml"
    fault = "faults: [{kind: unplug, at_field: 8, back_after_s: 1}]"
    file.write_text(FAST.format(configs=shipped_configs()).replace("pace: free", f"pace: free, {fault}"))
    out = tmp_path / "away.grab"
    result = run("capture", "--config", file, "--fields", 30, "--on-interruption", "end", "--out", out)
    assert result.exit_code == 1
    assert "interrupted" in str(result.exception)
    with CaptureReader(out) as reader:
        assert reader.ledger.received == 8
        assert "interrupted" in str(reader.meta.ended_because)


def test_without_a_daemon_the_status_says_how_to_start_one() -> None:
    result = shell("status", "--url", "http://127.0.0.1:9")
    assert result.returncode == 1
    assert "grabberd serve" in result.stderr


def test_two_daemons_do_not_share_a_folder_of_captures(tmp_path: Path) -> None:
    lock = DirectoryLock(tmp_path / "captures")
    lock.acquire()
    command = [sys.executable, "-c", "from grabberd.cli import main; main()", "serve", "--port", "0"]
    environment = {**os.environ, "STATE_DIRECTORY": str(tmp_path)}
    result = subprocess.run(
        command, capture_output=True, text=True, timeout=120, check=False, env=environment
    )
    lock.release()
    assert result.returncode == 1
    assert "another grabberd uses" in result.stderr
    assert "Traceback" not in result.stderr


def test_importing_the_server_stays_light() -> None:
    heavy = "scipy.optimize", "pyarrow", "matplotlib"
    modules = "grabberd.server.api, grabberd.server.daemon.service, sys"
    code = f"import {modules}; print([m for m in {heavy} if m in sys.modules])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_a_folder_in_place_of_a_capture_is_called_one(tmp_path: Path) -> None:
    result = typed("export", tmp_path, "--out", tmp_path / "out")
    assert f"{tmp_path} is a folder, not a capture file" in result.stderr


def test_a_backup_that_is_not_there_is_not_called_damaged(tmp_path: Path) -> None:
    result = typed("restore", tmp_path / "nowhere.zip")
    assert "there is no backup" in result.stderr


def test_another_user_s_state_is_told_with_whom_to_be(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object) -> None:
        raise PermissionError(13, "Permission denied", "/var/lib/grabberd/state.sqlite")

    monkeypatch.setattr("grabberd.cli.token._access", refused)
    result = typed("token", "list")
    assert result.returncode == 1
    assert "no permission for /var/lib/grabberd/state.sqlite" in result.stderr
    assert "sudo -u grabberd" in result.stderr


def test_without_words_the_first_steps_are_shown_and_a_slip_is_answered_with_the_nearest_command() -> None:
    assert "First steps:" in run().output
    assert "Did you mean 'calibrate'" in run("calibarte").output
