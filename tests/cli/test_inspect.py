"""`grabberd inspect`: from a folder of pictures of unknown origin to a configuration that captures them."""

import json
import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from typer.testing import CliRunner, Result

from core.chain.drawn_discs import frame as discs
from core.chain.drawn_footage import footage
from drivers.replay.videos import by_ffmpeg, needs_ffmpeg
from drivers.v4l2.bench import Bench, camera
from grabberd.archive.capture.reader import CaptureReader
from grabberd.cli.app import app
from grabberd.core.field import unpack

VGA = {"columns": 640, "lines": 480, "split": 300, "diameter_px": 5.0, "pitch_px": 24.0}


def run(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Forty progressive pictures of 640 x 480 pixels."""
    folder = tmp_path_factory.mktemp("footage")
    for number, picture in enumerate(footage("progressive", 40, **VGA)):
        cv2.imwrite(str(folder / f"picture-{number:04d}.png"), picture)
    return folder


def test_what_it_writes_captures_the_pictures_as_they_are(folder: Path, tmp_path: Path) -> None:
    config = tmp_path / "rig.yaml"
    result = run("inspect", folder, "--rate-hz", 60, "--out", config)
    assert result.exit_code == 0, result.output
    assert "progressive: every line is of the same moment" in result.output
    assert run("check-config", config).exit_code == 0
    device = yaml.safe_load(config.read_text())["devices"]["camera"]
    assert device["options"] == {"path": str(folder), "pictures": "progressive", "rate_hz": 60}
    assert (device["rig"]["columns"], device["rig"]["lines"]) == (640, 480)
    assert device["rig"]["views"]["left"]["end_column"] == pytest.approx(300, abs=12)
    captured = run("capture", "--config", config, "--fields", 30, "--out", tmp_path / "c.grab", "--json")
    assert captured.exit_code == 0, captured.output
    document = json.loads(captured.stdout)
    assert (document["verdict"], document["lines"], document["rate_hz"]) == ("complete", None, 60.0)
    again = json.loads(run("inspect", tmp_path / "c.grab", "--json").stdout)
    assert (again["interlacing"], again["lines"], again["rate_hz"]) == ("progressive", 480, 60.0)
    assert again["problems"] == []


def test_a_rig_of_another_size_is_refused_before_anything_is_captured(folder: Path, tmp_path: Path) -> None:
    config, wrong = tmp_path / "rig.yaml", tmp_path / "wrong.yaml"
    run("inspect", folder, "--rate-hz", 60, "--out", config)
    document = yaml.safe_load(config.read_text())
    del document["devices"]["camera"]["rig"]
    wrong.write_text(yaml.safe_dump(document))
    result = run("capture", "--config", wrong, "--fields", 10, "--out", tmp_path / "c.grab")
    assert result.exit_code != 0
    assert "640x480" in str(result.exception)
    assert "720x576" in str(result.exception)
    assert not (tmp_path / "c.grab").exists()


def test_a_rate_that_nothing_tells_is_asked_for(folder: Path, tmp_path: Path) -> None:
    result = run("inspect", folder, "--out", tmp_path / "rig.yaml")
    assert "give --rate-hz" in result.output
    assert "# rate_hz" in (tmp_path / "rig.yaml").read_text()


def test_what_comes_before_a_damaged_picture_is_looked_at_all_the_same(folder: Path, tmp_path: Path) -> None:
    damaged = tmp_path / "damaged"
    shutil.copytree(folder, damaged)
    (damaged / "picture-0036.png").write_bytes(b"no picture")
    found = json.loads(run("inspect", damaged, "--json").stdout)
    assert found["interlacing"] == "progressive"
    assert any("picture-0036.png" in problem for problem in found["problems"])


def test_nothing_is_overwritten(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text("mine")
    assert run("inspect", folder, "--out", tmp_path / "rig.yaml").exit_code != 0
    assert (tmp_path / "rig.yaml").read_text() == "mine"


@pytest.mark.parametrize("fourcc", ["YUYV", "MJPG"])
def test_a_digital_camera_is_named_with_what_it_was_looked_at_in(
    fourcc: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    film = list(footage("progressive", 40, **VGA))
    seen = camera(
        modes={fourcc: {(640, 480): (60, 30)}}, scene=lambda number, _columns, _lines: film[number % 40]
    )
    bench = Bench(tmp_path, seen)
    monkeypatch.setattr("grabberd_v4l2.grabber.LinuxKernel", lambda: bench.kernel)
    result = run("inspect", f"v4l2:{bench.node}", "--out", tmp_path / "rig.yaml")
    assert result.exit_code == 0, result.output
    assert "60 pictures a second" in result.output
    assert run("check-config", tmp_path / "rig.yaml").exit_code == 0
    device = yaml.safe_load((tmp_path / "rig.yaml").read_text())["devices"]["camera"]
    chosen = {"device": str(bench.node), "size": "640x480", "rate_hz": 60.0, "format": fourcc}
    assert (device["driver"], device["options"]) == ("v4l2", chosen)
    assert (device["rig"]["columns"], device["rig"]["lines"]) == (640, 480)
    assert device["rig"]["views"]["left"]["end_column"] == pytest.approx(300, abs=12)


# --- pictures that are not what they seem ---


def written(folder: Path, pictures: Iterable[np.ndarray]) -> Path:
    folder.mkdir()
    for number, picture in enumerate(pictures):
        cv2.imwrite(str(folder / f"{number:04d}.png"), picture)
    return folder


def swung(number: float) -> np.ndarray:
    """A frame at a time: discs that go up and down."""
    return discs((0.0, 6.0 * np.sin(number / 9)), np.random.default_rng(round(10 * number)))


def test_stacked_fields_are_named_with_the_filter_that_weaves_them_and_no_configuration(
    tmp_path: Path,
) -> None:
    stacked = (np.vstack([swung(2 * n)[::2], swung(2 * n + 1)[1::2]]) for n in range(40))
    folder, config = written(tmp_path / "stacked", stacked), tmp_path / "rig.yaml"
    result = run("inspect", folder, "--out", config)
    assert "both fields of a frame lie one above the other" in result.output
    assert "top field in the upper half" in result.output
    assert "-vf 'il=l=i:c=i'" in result.output
    assert "was not written" in str(result.exception)
    assert not config.exists()
    found = json.loads(run("inspect", folder, "--json").stdout)
    assert found["interlacing"] == "unknown"
    assert found["layout"] == {"kind": "fields_one_above_the_other", "part": "top"}


@needs_ffmpeg
@pytest.mark.parametrize("bottom", [0, 1])
def test_the_filter_makes_frames_of_stacked_fields(tmp_path: Path, bottom: int) -> None:
    frames = []
    for n in range(40):
        frame = swung(2 * n)
        frame[1::2] = swung(2 * n + 1)[1::2]
        frames.append(frame)
    halves = (np.vstack([frame[bottom::2], frame[1 - bottom :: 2]]) for frame in frames)
    folder, woven = written(tmp_path / "stacked", halves), tmp_path / "woven"
    (note,) = json.loads(run("inspect", folder, "--json").stdout)["problems"]
    woven.mkdir()
    filters = note.split("'")[1]
    command = ("ffmpeg", "-v", "error", "-i", folder / "%04d.png", "-vf", filters, woven / "%04d.png")
    subprocess.run([str(word) for word in command], check=True)
    again = [cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in sorted(woven.iterdir())]
    assert all((one == other).all() for one, other in zip(again, frames, strict=True))


@pytest.mark.parametrize("first", ["top", "bottom"])
def test_single_fields_are_captured_with_the_parity_that_they_show(tmp_path: Path, first: str) -> None:
    begin = int(first == "bottom")
    folder = written(tmp_path / "fields", (swung(n)[n % 2 :: 2] for n in range(begin, 80 + begin)))
    config, out = tmp_path / "rig.yaml", tmp_path / "a.grab"
    result = run("inspect", folder, "--rate-hz", 50, "--out", config)
    assert f"the {first} one first" in result.output
    options = yaml.safe_load(config.read_text())["devices"]["camera"]["options"]
    assert options == {"path": str(folder), "pictures": "fields", "first_parity": first, "rate_hz": 50}
    assert run("capture", "--config", config, "--bits", 8, "--out", out).exit_code == 0
    with CaptureReader(out) as reader:
        assert next(reader.fields()).numbered.packed.parity == begin
    assert json.loads(run("inspect", out, "--json").stdout)["order"]["order"] == "right"


@needs_ffmpeg
def test_a_still_clip_that_may_be_woven_is_not_believed_to_be_progressive(tmp_path: Path) -> None:
    video, config = tmp_path / "still.mkv", tmp_path / "rig.yaml"
    noise, (calm,) = (
        np.random.default_rng(1),
        footage("progressive", 1, **{**VGA, "columns": 720, "lines": 576}),
    )
    still = [np.clip(calm + noise.normal(0, 2, calm.shape), 0, 255).astype(np.uint8) for _ in range(3)]
    by_ffmpeg(video, still, "-vf", "setfield=prog", "-c:v", "ffv1")
    found = run("inspect", video, "--out", config)
    assert "recorders often forget the mark" in found.output
    assert "pictures: frames   # as their size suggests" in config.read_text()


# --- what is stated beside ---


def test_options_of_the_driver_are_given_word_by_word_and_written(folder: Path, tmp_path: Path) -> None:
    config = tmp_path / "rig.yaml"
    words = ("--option", "pictures=progressive", "--option", "rate_hz=60")
    assert run("inspect", folder, *words, "--out", config).exit_code == 0
    options = yaml.safe_load(config.read_text())["devices"]["camera"]["options"]
    assert options == {"path": str(folder), "pictures": "progressive", "rate_hz": 60}
    out = tmp_path / "a.grab"
    captured = run("capture", "--config", config, "--device", f"replay:{folder}", *words, "-o", out, "--json")
    assert captured.exit_code == 0, captured.output
    assert json.loads(captured.stdout)["fields"] == 40
    field_by_field = run("inspect", folder, "--option", "pictures=fields", "--rate-hz", 60, "--json")
    assert json.loads(field_by_field.stdout)["lines"] == 960


@pytest.mark.parametrize("word", ["pictures", "=frames", "pictures=[a"])
def test_an_option_that_is_no_key_and_value_is_refused(folder: Path, word: str) -> None:
    result = run("inspect", folder, "--option", word)
    assert result.exit_code == 2
    assert "--option" in result.output


def test_an_option_that_no_driver_knows_is_refused_by_name(folder: Path) -> None:
    result = run("inspect", folder, "--option", "colour=red")
    assert "colour" in str(result.exception)


def test_options_of_a_device_that_a_daemon_holds_are_refused(tmp_path: Path) -> None:
    result = run(
        "capture", "--url", "http://127.0.0.1:1", "--option", "rate_hz=60", "-o", tmp_path / "a.grab"
    )
    assert result.exit_code == 2
    assert "no daemon holds" in result.output


@needs_ffmpeg
@pytest.mark.parametrize(("mark", "first"), [("tff", "top_first"), ("bff", "bottom_first")])
def test_an_interlaced_video_is_captured_in_the_order_that_it_shows(
    tmp_path: Path, mark: str, first: str
) -> None:
    video, config, out = tmp_path / "a.mkv", tmp_path / "rig.yaml", tmp_path / "a.grab"
    pictures = [*footage(first, 40, **VGA)]
    by_ffmpeg(video, pictures, "-vf", f"setfield={mark}", "-c:v", "ffv1", "-flags", "+ilme")
    found = json.loads(run("inspect", video, "--out", config, "--json").stdout)
    assert (found["interlacing"], found["rate_hz"]) == (first, 50.0)
    assert not any("marked" in one for one in found["problems"])
    captured = run("capture", "--config", config, "--bits", 8, "--out", out, "--json")
    assert captured.exit_code == 0, captured.output
    assert json.loads(captured.stdout)["fields"] == 80
    with CaptureReader(out) as reader:
        fields = [unpack(one.packed) for one in reader.received()]
    for number, field in enumerate(fields):
        assert field.parity == (number + (first == "bottom_first")) % 2
        assert (field.luma == pictures[number // 2][field.parity :: 2]).all()


@needs_ffmpeg
def test_pictures_are_believed_more_than_a_mark_and_a_mark_more_than_nothing(tmp_path: Path) -> None:
    wrong, still = tmp_path / "wrong.mkv", tmp_path / "still.mkv"
    options = ("-c:v", "ffv1", "-flags", "+ilme")
    pictures = [*footage("bottom_first", 40, **VGA)]
    by_ffmpeg(wrong, pictures, "-vf", "setfield=tff", *options)
    found = json.loads(run("inspect", wrong, "--json").stdout)
    assert found["interlacing"] == "bottom_first"
    assert any("marked as top_first, but its pictures show bottom_first" in one for one in found["problems"])
    noise, (calm,) = np.random.default_rng(1), footage("progressive", 1, **VGA)
    by_ffmpeg(
        still,
        [np.clip(calm + noise.normal(0, 2, calm.shape), 0, 255).astype(np.uint8)] * 3,
        *("-vf", "setfield=bff", *options),
    )
    found = json.loads(run("inspect", still, "--json").stdout)
    assert found["interlacing"] == "bottom_first"
    assert any("marked as bottom_first" in one for one in found["problems"])
