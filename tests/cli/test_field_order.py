"""`grabberd devices --check-field-order`: an installer moves something and is told what to write."""

import json
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner, Result

from grabberd.cli.app import app
from grabberd.core.field import BOTTOM, TOP
from grabberd.errors import DeviceRefused, StreamFailed
from grabberd.instrument.acquisition import GRABBERS

MOVING = {"scene": "ellipse", "pace": "free", "picture": {"stamp": False}}
FIELDS = 150

DRIVER = """
import contextlib
from grabberd.core.field import FieldOrder
from grabberd.instrument.acquisition import StreamInfo
from grabberd.errors import DeviceRefused

class Grabber:
    called_ns = 0
    found_empty = True

    def __init__(self, what):
        self.what = what

    def open(self):
        if self.what == "busy":
            raise DeviceRefused("/dev/video0 is in use by another program", "end that program")
        known = {"one parity": FieldOrder.ONE_PARITY, "progressive": FieldOrder.PROGRESSIVE}
        order = known.get(self.what, FieldOrder.ALTERNATE)
        return StreamInfo(
            "barn", "Bt878", "PAL", 720, 288, 50.0, order, "GREY", 8, True, True, True, 1_000_000
        )

    @contextlib.contextmanager
    def dequeue(self, timeout_s):
        yield []

    def close(self):
        pass
"""


@pytest.fixture(scope="module")
def fields() -> list[np.ndarray]:
    """What the simulated camera sees of a liner that moves, top field first."""
    grabber, seen = GRABBERS.create("fake", MOVING), []
    grabber.open()
    while len(seen) < FIELDS:
        with grabber.dequeue(1.0) as grabbed:
            seen += [one.field.luma.copy() for one in grabbed]
    grabber.close()
    return seen[:FIELDS]


@pytest.fixture(scope="module")
def recording(fields, tmp_path_factory) -> Path:
    """The same as woven frames."""
    return woven(tmp_path_factory.mktemp("recording"), zip(fields[::2], fields[1::2], strict=True))


def woven(folder: Path, pairs) -> Path:
    for number, (top, bottom) in enumerate(pairs):
        frame = np.empty((576, 720), np.uint8)
        frame[TOP::2], frame[BOTTOM::2] = top, bottom
        cv2.imwrite(str(folder / f"frame-{number:04}.png"), frame, [cv2.IMWRITE_PNG_COMPRESSION, 0])
    return folder


def check(config: Path, *words: object) -> Result:
    command = ["devices", "--check-field-order", "--config", config, *words]
    return CliRunner().invoke(app, [str(word) for word in command])


def configured(folder: Path, driver: str, **options: object) -> Path:
    """A configuration with one device; JSON is YAML."""
    file = folder / "grabberd.yaml"
    file.write_text(json.dumps({"devices": {"grabber": {"driver": driver, "options": options}}}))
    return file


def replayed(tmp_path: Path, path: Path, **options: object) -> Path:
    return configured(tmp_path, "replay", path=str(path), **options)


def test_a_right_order_is_said_to_be_right(recording, tmp_path):
    result = check(replayed(tmp_path, recording))
    assert result.exit_code == 0, result.output
    assert "grabber: the field order is right" in result.output
    assert "nothing to do" in result.output


def test_the_simulated_grabber_is_right_stamp_and_all(tmp_path):
    result = check(configured(tmp_path, "fake", scene="liner", pace="free"))
    assert result.exit_code == 0, result.output


def test_a_reversed_order_is_said_with_what_to_write(recording, tmp_path):
    result = check(replayed(tmp_path, recording, field_order="bottom_first"))
    assert result.exit_code == 3
    assert "the field order is reversed" in result.output
    assert "'field_order: top_first'" in result.output


def test_a_grabber_that_throws_a_field_away_is_found_out(fields, tmp_path):
    folder = tmp_path / "frames"
    folder.mkdir()
    lied = woven(folder, ((top, (top // 2 + np.roll(top, -1, 0) // 2)) for top in fields[::2]))
    result = check(replayed(tmp_path, lied))
    assert result.exit_code == 3
    assert "discards one field" in result.output
    assert "use another" in result.output


def test_where_nothing_moves_there_is_no_verdict(fields, tmp_path):
    folder = tmp_path / "frames"
    folder.mkdir()
    result = check(replayed(tmp_path, woven(folder, [(fields[0], fields[1])] * 40)))
    assert result.exit_code == 3
    assert "nothing moved" in result.output
    assert "try again" in result.output


def test_json_has_the_numbers(recording, tmp_path):
    document = json.loads(check(replayed(tmp_path, recording), "--json").stdout)
    assert (document["device"], document["order"]) == ("grabber", "right")
    assert 100 < document["fields"] <= FIELDS
    assert document["top_to_bottom"]["value"] == pytest.approx(1, abs=0.3)
    assert 0 < document["bottom_to_top"]["sigma"] < 0.3


def test_a_recording_can_be_named_in_place_of_a_device(recording, tmp_path):
    result = check(configured(tmp_path, "fake", **MOVING), f"replay:{recording}")
    assert "the field order is right" in result.output


@pytest.fixture
def barn(tmp_path, monkeypatch):
    """A driver that does not stream."""
    info = tmp_path / "barn-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: barn\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[grabberd.drivers]\nbarn = barn_grabber:Grabber\n")
    (tmp_path / "barn_grabber.py").write_text(DRIVER)
    monkeypatch.syspath_prepend(tmp_path)
    yield
    sys.modules.pop("barn_grabber", None)


@pytest.mark.usefixtures("barn")
def test_a_device_that_a_daemon_holds_is_busy_and_the_hint_says_so(tmp_path):
    error = check(configured(tmp_path, "barn", what="busy")).exception
    assert isinstance(error, DeviceRefused)
    assert "in use" in error.message
    assert "a running daemon holds its devices: stop it" in error.hint


@pytest.mark.usefixtures("barn")
def test_one_parity_has_no_order(tmp_path):
    error = check(configured(tmp_path, "barn", what="one parity")).exception
    assert isinstance(error, DeviceRefused)
    assert "one field of every frame" in error.message


@pytest.mark.usefixtures("barn")
def test_progressive_pictures_have_no_order(tmp_path):
    error = check(configured(tmp_path, "barn", what="progressive")).exception
    assert isinstance(error, DeviceRefused)
    assert "progressive pictures, without fields" in error.message
    assert "nothing to do" in error.hint


@pytest.mark.usefixtures("barn")
def test_a_device_that_delivers_nothing_is_given_up(tmp_path):
    error = check(configured(tmp_path, "barn", what="silence")).exception
    assert isinstance(error, StreamFailed)
    assert "no field came" in error.message
