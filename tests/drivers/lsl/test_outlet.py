"""A whole capture on the Lab Streaming Layer, as somebody else's program receives it."""

import json
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from running import PATIENCE_S

from grabberd.archive.capture.reader import CaptureReader
from grabberd.client.daemon import Daemon as Asked
from grabberd.core.reconstruction.points import Points
from grabberd.instrument.capture.capture_request import CaptureRequest
from server.api.conftest import sealed_in
from server.api.daemons import Daemon, serving

FIELDS, HALF_A_FIELD_S = 150, 0.01
INLET = Path(__file__).parent / "inlet.py"


class Received(NamedTuple):
    """What the inlets got, and the capture of the same fields."""

    file: Path
    found: dict[str, NDArray[Any]]
    object: dict[str, Any]

    @property
    def events(self) -> list[dict[str, Any]]:
        return [json.loads(text) for text in self.found["events"]]

    def described(self, stream: int) -> ET.Element:
        return ET.fromstring(str(self.found["described"][stream]))


@pytest.fixture(scope="module")
def received(tmp_path_factory: pytest.TempPathFactory, lsl: dict[str, str]) -> Iterator[Received]:
    folder = tmp_path_factory.mktemp("received")
    with serving(folder / "state", pace="real") as daemon:
        words = "from grabberd.cli import main; main()"
        command = [sys.executable, "-c", words, "outlet", "lsl", "--url", daemon.url]
        with subprocess.Popen(command, env=lsl, stderr=subprocess.PIPE, text=True) as outlet:
            try:
                yield record(daemon, folder / "received.npz", lsl)
            finally:
                outlet.terminate()
                _, said = outlet.communicate(timeout=PATIENCE_S)
        assert said == "streams: grabberd-simulated-points, grabberd-simulated-events\n"


def record(daemon: Daemon, out: Path, lsl: dict[str, str]) -> Received:
    """Has a program of its own receive a capture from its first field to its end."""
    command = [sys.executable, str(INLET), "simulated", str(out)]
    with subprocess.Popen(command, env=lsl, stdout=subprocess.PIPE, text=True) as peer:
        assert peer.stdout is not None
        assert peer.stdout.readline() == "open\n"
        request = CaptureRequest(fields=FIELDS, labels={"cow": "112"})
        capture = daemon.service.capture_control.start(None, request)
        sealed_in(daemon.service)
        assert peer.wait(PATIENCE_S) == 0
    document = daemon.service.archive.document(capture.id)
    with np.load(out) as found:
        arrays = dict(found)
    file = daemon.service.archive.directory / f"{capture.id}.grab"
    assert document.state == "sealed"
    nominal = Asked(daemon.url).ask("/api/v1/devices/simulated/object")
    return Received(file, arrays, nominal)


def in_the_capture(received: Received) -> list[tuple[Points, NDArray[np.float32], float]]:
    """The points of the capture's fields, with sample and time error of each that was received.

    On a computer that is too busy the outlet misses some, and says how many.
    """
    with CaptureReader(received.file) as reader:
        # The first ones may have been measured, and sent, just before they belonged to a capture.
        fields = list(reader.timed_points(first_n=2))
    samples, own_s = received.found["samples"], received.found["times_s"]
    found = []
    for _, time_ns, points in fields:
        nearest = int(np.abs(own_s - time_ns / 1e9).argmin())
        if (error_s := abs(own_s[nearest] - time_ns / 1e9)) < HALF_A_FIELD_S:
            found.append((points, samples[nearest], float(error_s)))
    missed = sum(one["fields"] for one in received.events if one["event"] == "points_missed")
    assert len(found) >= max(len(fields) - missed, FIELDS // 3)
    return found


def test_every_field_of_a_capture_comes_with_the_positions_of_its_file_bit_for_bit(
    received: Received,
) -> None:
    index = {target: k for k, target in enumerate(received.object["target"])}
    for points, sample, _ in in_the_capture(received):
        expected = np.full((len(index), 3), np.nan, np.float32)
        expected[[index[one] for one in points.target.tolist()]] = points.xyz_mm.astype(np.float32)
        own = np.ascontiguousarray(sample.reshape(-1, 6)[:, :3])
        found = ~np.isnan(expected)
        assert np.array_equal(np.isnan(own), ~found)
        assert own[found].tobytes() == expected[found].tobytes()


def test_their_standard_deviations_are_those_of_the_file_as_finely_as_it_keeps_them(
    received: Received,
) -> None:
    index = {target: k for k, target in enumerate(received.object["target"])}
    for points, sample, _ in in_the_capture(received):
        at = [index[one] for one in points.target.tolist()]
        sigma_mm = np.sqrt(points.covariance_mm2[:, [0, 1, 2], [0, 1, 2]])
        assert np.allclose(sample.reshape(-1, 6)[at, 3:], sigma_mm, rtol=1e-3, atol=0)


def test_they_bear_the_times_of_the_file(received: Received) -> None:
    assert max(error_s for _, _, error_s in in_the_capture(received)) < 1e-3
    assert (np.diff(received.found["times_s"]) > 0).all()
    assert abs(received.found["correction_s"]) < 1e-3


def test_the_channels_are_described(received: Received) -> None:
    info = received.described(0)
    assert info.findtext("type") == "MoCap"
    assert float(info.findtext("nominal_srate") or 0) == 50
    channels = info.findall("desc/channels/channel")
    assert len(channels) == int(info.findtext("channel_count") or 0) == 6 * len(received.object["target"])
    said = {one.tag: one.text for one in channels[1]}
    first = {key: received.object[key][0] for key in ("target", "row", "column")}
    assert said == {
        "label": f"{first['target']}_y",
        "type": "PositionY",
        "unit": "millimeters",
        **{key: str(value) for key, value in first.items()},
    }
    assert info.findtext("desc/acquisition/clock") == "monotonic"
    assert info.findtext("desc/acquisition/calibration_id")


def test_the_events_tell_of_the_capture_with_its_verdict_at_its_own_times(received: Received) -> None:
    told = {one["event"]: one for one in received.events}
    at_s = dict(zip((one["event"] for one in received.events), received.found["event_times_s"], strict=True))
    with CaptureReader(received.file) as reader:
        first_s, rate_hz = (reader.first_time_ns or 0) / 1e9, reader.meta.rate_hz
        assert told["capture_started"]["capture_id"] == told["capture_ended"]["capture_id"] == reader.meta.id
    assert told["capture_started"]["labels"] == {"cow": "112"}
    ended = told["capture_ended"]
    assert ended["verdict"] == ("complete" if ended["counts"]["received"] == FIELDS else "incomplete")
    assert at_s["capture_started"] == pytest.approx(first_s, abs=0.01)
    assert at_s["capture_ended"] == pytest.approx(first_s + FIELDS / rate_hz, abs=0.05)
    assert told["health"]["level"] in ("good", "unknown", "warning")
